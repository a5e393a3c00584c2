"""What a flight's readings.jsonl may hold when the flight is taken up again."""

import pytest

from posse_core._errors import InputError
from posse_core._flight.readings_log import READINGS, ReadingsLog


@pytest.mark.parametrize(
    "line",
    [
        "[]",
        "3",
        '{"index": 0}',
        "{",
        '{"vision": 3, "clouds": 1, "keypoints": 2}',
        pytest.param("[" * 10**5 + "]" * 10**5, id="nested deeply"),
    ],
)
def test_a_line_that_is_no_reading_is_told_without_words_of_python(tmp_path, line):
    (tmp_path / READINGS).write_text(line + "\n")
    with pytest.raises(InputError, match=r"readings\.jsonl: a line is not the readings of a frame; fly"):
        ReadingsLog(tmp_path).recover({0})
