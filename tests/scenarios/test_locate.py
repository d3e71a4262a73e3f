"""Lines of keys in TOML texts."""

import pytest

from contourlab.scenarios.locate import line_of

TEXT = """# comment
[part]
file = "a"   # [not.a.table]

[machine]
name = "x"
[machine.set]
"drive.limit" = 3
[[controller]]
kp = 1
axis = { kp = 2 }
[[controller]]
kp = 3
[controller.axis]
kd = 4
a.b = 5
"""


@pytest.mark.parametrize(
    ("key", "line"),
    [
        (("part",), 2),
        (("part", "file"), 3),
        (("machine", "set"), 7),
        (("controller", 0), 9),
        (("controller", 0, "kp"), 10),
        (("controller", 0, "axis", "kp"), 11),  # the inline table's line
        (("controller", 1, "kp"), 13),
        (("controller", 1, "axis", "kd"), 15),
        (("controller", 1, "axis", "a", "b"), 16),
        (("controller", 1, "missing"), 12),
        (("nothing",), 0),
    ],
)
def test_line_of(key, line):
    assert line_of(TEXT, key) == line
