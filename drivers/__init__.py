"""The machine: links, the controller's language and rules, the lathe on top of them, and a simulator."""
