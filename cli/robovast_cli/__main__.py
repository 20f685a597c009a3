"""`python -m robovast_cli`: the command `vast`."""

from robovast_cli.entry import main

main()
