"""`vast exec cluster prepare-run`: a campaign that kubectl alone can start."""

from __future__ import annotations

from pathlib import Path

from robovast.base.any_yaml import dump_any
from robovast.base.errors import StorageError
from robovast.base.file_errors import refuse_obstacle, writing
from robovast.kubeapi.submission import SubmitOptions, campaign_name, prepare_submission
from robovast.model.document import Document
from robovast.storage.bucket_names import BUNDLES_BUCKET
from robovast_cli.ui.output import say

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


def prepare_run(
    document: Document, options: SubmitOptions, namespace: str | None, output: Path
) -> None:
    """Write the Campaign of a document, its archive when it needs one, and instructions.

    Raises:
        StorageError: the folder cannot be written, or holds something else.
    """
    name = campaign_name(document, unique=False)
    submission = prepare_submission(document, options, name, namespace)
    where = f" --namespace {namespace}" if namespace else ""
    text = _README.format(name=name, namespace=where)
    refuse_obstacle(output)
    with writing(output):
        if output.is_dir() and any(output.iterdir()) and not (output / FILE).is_file():
            raise StorageError(
                f"{output} contains other files", hint="choose a new or empty folder"
            )
        output.mkdir(parents=True, exist_ok=True)
        (output / FILE).write_text(dump_any(submission.campaign), encoding="utf-8")
        if submission.archive:
            key = submission.archive.key
            (output / key).write_bytes(submission.archive.content)
            text += _UPLOAD.format(key=key, bucket=BUNDLES_BUCKET)
        (output / "README.md").write_text(text, encoding="utf-8")
    say(f"Next: follow {output / 'README.md'}.")
