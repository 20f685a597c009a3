"""What people see, shared by all commands."""
