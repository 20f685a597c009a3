"""Parse a scenario with scenario-execution's grammar, and print the first error as JSON.

Executed by the Python of scenario-execution's environment, where RoboVAST is not installed.
"""

import importlib
import json
import sys
from typing import Any

GRAMMAR = "scenario_execution.osc2_parsing.OpenSCENARIO2"


def mistake_in(path: str) -> Any:
    """Line, column (both from 1) and text of the first syntax error, or None."""
    antlr4 = importlib.import_module("antlr4")
    listeners = importlib.import_module("antlr4.error.ErrorListener")
    mistakes = []

    text = antlr4.FileStream(path, encoding="utf-8")

    class Listener(listeners.ErrorListener):  # type: ignore[misc, name-defined]
        def syntaxError(self, _recognizer, symbol, line, column, _said, _error):  # type: ignore[no-untyped-def] # noqa: N802
            if symbol is None:  # of the lexer; a token that ends a line tells where it began alone
                mistakes.append({"line": line, "column": column + 1, "found": None})
                return
            before = text.strdata[: symbol.start]
            place = {"line": before.count("\n") + 1, "column": len(before) - before.rfind("\n")}
            mistakes.append({**place, "found": symbol.text})

    lexer = importlib.import_module(f"{GRAMMAR}Lexer").OpenSCENARIO2Lexer(text)
    tokens = antlr4.CommonTokenStream(lexer)
    parser = importlib.import_module(f"{GRAMMAR}Parser").OpenSCENARIO2Parser(tokens)
    for recognizer in (lexer, parser):
        recognizer.removeErrorListeners()
        recognizer.addErrorListener(Listener())
    parser.osc_file()
    return mistakes[0] if mistakes else None


if __name__ == "__main__":
    sys.stdout.write(json.dumps(mistake_in(sys.argv[1])))
