"""`vast exec cluster prepare-run`: write a campaign that kubectl can start."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from robovast.base.errors import StorageError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.base.serialization import dump_yaml
from robovast.kubeapi.submission import SubmitOptions, campaign_name, prepare_submission
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.commands.exec.cluster.run import Image
from robovast_cli.commands.exec.local import Debug, LogTree, Runs, Select
from robovast_cli.kube.options import Context, Namespace, SetupOptions, setup_config
from robovast_cli.lazy import examples
from robovast_cli.ui.output import echo

FILE = "campaign.yaml"

_README = """\
# Campaign {name}

```bash
kubectl apply --server-side --filename campaign.yaml{namespace}
kubectl wait --for=condition=ResultsAvailable campaign/{name} --timeout=24h{namespace}
vast results download -i {name}
```
"""

_UPLOAD = """
The files of the .vast file are too large for the Campaign, which expects `{key}` in the bucket
`{bucket}` of the S3 server. Upload the archive with an S3 client, for example:

```bash
aws --endpoint-url URL s3 cp {key} s3://{bucket}/{key}
```
"""


@examples(
    ("vast exec cluster prepare-run manual", "Prepare all configurations"),
    ("vast exec cluster prepare-run manual -c 'hall-*' --runs 2", "Prepare a selection"),
)
def prepare_run(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="DIR", help="New or empty folder.")],
    config: Select = None,
    runs: Runs = None,
    image: Image = None,
    log_tree: LogTree = False,
    debug: Debug = False,
    _cluster_config: Annotated[str | None, setup_config("k")] = None,
    _options: SetupOptions = None,
    context: Context = None,
    namespace: Namespace = None,
) -> None:
    """Write the Campaign and instructions to run it with kubectl."""
    options = SubmitOptions(config, runs, image, log_tree, debug, context)
    document = ctx.obj.document()
    name = campaign_name(document, unique=False)
    submission = prepare_submission(document, options, name, namespace)
    where = f" --namespace {namespace}" if namespace else ""
    text = _README.format(name=name, namespace=where)
    refuse_obstacle(out)
    with writing(out):
        if out.is_dir() and any(out.iterdir()) and not (out / FILE).is_file():
            raise StorageError(f"{out} contains other files", hint="choose a new or empty folder")
        out.mkdir(parents=True, exist_ok=True)
        (out / FILE).write_text(dump_yaml(submission.campaign), encoding="utf-8")
        if submission.archive:
            key = submission.archive.key
            (out / key).write_bytes(submission.archive.content)
            text += _UPLOAD.format(key=key, bucket=BUNDLES_BUCKET)
        (out / "README.md").write_text(text, encoding="utf-8")
    echo(f"Next: follow {out / 'README.md'}.")
