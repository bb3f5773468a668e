"""The state of a running console as JSON lines, for programs that only read: schema, socket, server and client."""
