"""What others send as a size is a size, or the default."""

from hypothesis import given
from hypothesis import strategies as st

from robovast.base.sizes import whole_number

ODD = st.sampled_from(
    ["9" * 5000, "\u00b2", "\u0663", "1_0", " 1", "1\n", "-1", "+1", "1e3", "0x1"]
)


@given(st.none() | st.text() | st.text("0123456789\u00b2\u0663", max_size=20) | ODD)
def test_a_size_is_plain_digits(text: str | None) -> None:
    plain = text is not None and text.isascii() and text.isdecimal() and len(text) <= 18
    assert whole_number(text, -1) == (int(text or "") if plain else -1)
