"""`python -m robovast_cli`: the command `vast`."""

from robovast_cli.main import main

main()
