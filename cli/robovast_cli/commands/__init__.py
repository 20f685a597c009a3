"""The commands, in folders as people type them."""
