"""Names that are given to what a campaign leaves."""

from __future__ import annotations

from datetime import UTC, datetime
from uuid import uuid4

import pytest

from robovast.storage.bucket_names import BUCKET_LIMIT, bucket_name, buckets_of, campaign_id

NOW = datetime(2026, 3, 1, 10, 0, tzinfo=UTC)


@pytest.mark.parametrize("name", ["nav", "n" * 40, "Über_lang." * 20])
@pytest.mark.parametrize("prefix", ["", "p" * 30])
def test_campaigns_of_one_name_and_second_have_buckets_of_their_own(name: str, prefix: str) -> None:
    campaign = campaign_id({}, name, NOW)
    names = {bucket_name(campaign, prefix, str(uuid4())) for _ in range(3)}
    assert len(names) == 3
    assert max(map(len, names)) <= BUCKET_LIMIT


def test_a_bucket_is_found_by_the_name_of_its_results_with_a_uid_and_without() -> None:
    campaign = campaign_id({"name": "Nav.1"}, "x", NOW)
    own = [bucket_name(campaign, uid=str(uuid4())) for _ in range(2)]
    others = ["robovast-bundles", bucket_name(f"x-{campaign}", uid=str(uuid4())), f"{own[0]}a"]
    older = bucket_name(campaign)
    assert buckets_of(campaign, [*others, older, *own]) == [older, *own]
    assert buckets_of(own[0], [*others, older, *own]) == [own[0]]
