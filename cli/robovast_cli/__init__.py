"""The command line `vast`: parse, call the library, render."""
