"""RoboVAST: vary a scenario, execute all variants, and find out what failed, where and why.

This is the API for scripts; docs/how-to/scripting.md has examples.

```
load_document(path)          a checked .vast document
expand(document, folder)     its variants
run_campaign(document, …)    execute it on this machine
open_campaign(folder)        an executed campaign: its runs, and SQL over its tables
find_campaigns(results)      the folders of all campaigns in a folder
ask(folders, sql)            SQL over the tables of several campaigns
```

Names are imported on first use. `robovast.common` is for plugins and notebooks.
"""

from __future__ import annotations

from importlib import import_module

from robovast.base.version import __version__

TYPE_CHECKING = False  # `typing` alone would take longer to import than all of this
if TYPE_CHECKING:
    from typing import Any

    from robovast.analysis.tables.query import Answer, ask
    from robovast.base.errors import RobovastError
    from robovast.campaign.discovery import find_campaigns
    from robovast.campaign.verdict import Verdict
    from robovast.execution.local import LocalOptions
    from robovast.model.document import Document, load_document
    from robovast.model.expansion import Variant, expand
    from robovast.scripting import Campaign, StoredRun, open_campaign, run_campaign

_MODULES = {
    "Answer": "analysis.tables.query",
    "Campaign": "scripting",
    "Document": "model.document",
    "LocalOptions": "execution.local",
    "RobovastError": "base.errors",
    "StoredRun": "scripting",
    "Variant": "model.expansion",
    "Verdict": "campaign.verdict",
    "ask": "analysis.tables.query",
    "expand": "model.expansion",
    "find_campaigns": "campaign.discovery",
    "load_document": "model.document",
    "open_campaign": "scripting",
    "run_campaign": "scripting",
}

__all__ = [
    "Answer",
    "Campaign",
    "Document",
    "LocalOptions",
    "RobovastError",
    "StoredRun",
    "Variant",
    "Verdict",
    "__version__",
    "ask",
    "expand",
    "find_campaigns",
    "load_document",
    "open_campaign",
    "run_campaign",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
