"""The Campaign that buckets of tests belong to."""

from robovast.model.packs import Owner

OWNER = Owner(
    uid="5b2f6a34-0b0e-4b3c-9a1d-7f5c8e2d1a90",
    namespace="lab",
    name="test",
    campaign="test-2026-01-02-030405",
)
