"""What executes a campaign that is continued."""

from __future__ import annotations

import dataclasses

from robovast.base.yaml_files import read_mapping
from robovast.campaign.imported import is_imported
from robovast.campaign.layout import Layout
from robovast.execution.local.choose import CONTAINER, choose_runtime
from robovast.execution.local.events import ExecutionObserver, LocalOptions
from robovast.execution.local.process_environment import IMAGE, environment_as_then
from robovast.execution.local.session import Session
from robovast.model.document import Document


def continued_session(
    document: Document, layout: Layout, options: LocalOptions, observer: ExecutionObserver
) -> Session:
    """A session with what has executed the campaign so far, unless something else is chosen.

    Raises:
        CannotRunError: the runtime is not usable, or the environment of plain processes is gone.
    """
    before = str(read_mapping(layout.execution_record).get("image") or "")
    options = _as_before(before, layout, options)
    runtime = choose_runtime(document, options, observer.message)
    identity = runtime.check()
    if before not in {"", identity.image}:
        observer.message(f"Continuing with {identity.image}. Earlier runs used {before}.")
    return Session(document, layout, options, runtime, identity)


def _as_before(before: str, layout: Layout, options: LocalOptions) -> LocalOptions:
    """The options; if the runtime is open, a campaign of plain processes continues with these.

    One that was imported continues in a container, whatever its records say.
    """
    if options.runtime == "auto" and is_imported(layout.root):
        return dataclasses.replace(options, runtime=CONTAINER)
    if options.runtime != "auto" or options.image or not before.startswith(IMAGE):
        return options
    environment = environment_as_then(before, str(layout.root), "continue")
    return dataclasses.replace(options, runtime="process", process_environment=environment)
