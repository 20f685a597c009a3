"""Write schemas/vast.schema.json from the models of the .vast document."""

from pathlib import Path

from robovast.document.schema import schema_text

TARGET = Path(__file__).parents[1] / "schemas" / "vast.schema.json"

if __name__ == "__main__":
    TARGET.parent.mkdir(exist_ok=True)
    TARGET.write_text(schema_text(), encoding="utf-8")
