"""The screens: what an operator sees and presses. The only package that knows Textual."""
