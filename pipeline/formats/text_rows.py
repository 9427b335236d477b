"""Rows of numbers in a text file, read fast and tolerantly: a row that is not all numbers is counted, not fatal."""

from __future__ import annotations

import numba
import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

_SPACE, _TAB, _RETURN, _NEWLINE = 32, 9, 13, 10
_PLUS, _MINUS, _POINT, _ZERO, _NINE, _BIG_E, _SMALL_E = 43, 45, 46, 48, 57, 69, 101
_MAX_DIGITS = 18


def parse_rows(data: bytes, columns: int) -> tuple[F64, int]:
    """Every line of exactly ``columns`` decimal numbers apart by blanks, and how many other lines there were.

    Returns (N, columns) float64 and the count of lines that are neither blank nor such a row (a header, a cut last
    line, ``nan``, anything binary). Numbers are plain decimals with an optional exponent, at most 18 digits.
    """
    buffer = np.frombuffer(data, dtype=np.uint8)
    rows = np.empty((int(np.count_nonzero(buffer == _NEWLINE)) + 1, columns))
    kept, bad = _parse(buffer, rows)
    return rows[:kept], int(bad)


@numba.njit(cache=True, nogil=True)
def _parse(buffer: npt.NDArray[np.uint8], rows: F64) -> tuple[int, int]:
    columns = rows.shape[1]
    kept, bad, at = 0, 0, 0
    while at < buffer.size:
        column, good = 0, True
        while at < buffer.size and buffer[at] != _NEWLINE:
            if buffer[at] == _SPACE or buffer[at] == _TAB or buffer[at] == _RETURN:
                at += 1
                continue
            start = at
            while at < buffer.size and buffer[at] > _SPACE:
                at += 1
            if at == start:  # a control character that is no blank
                at += 1
            value = _number(buffer, start, at)
            good = good and column < columns and np.isfinite(value)
            if good:
                rows[kept, column] = value
            column += 1
        at += 1
        if good and column == columns:
            kept += 1
        elif column > 0:
            bad += 1
    return kept, bad


@numba.njit(cache=True, nogil=True)
def _number(buffer: npt.NDArray[np.uint8], start: int, stop: int) -> float:
    """The decimal number in buffer[start:stop]; NaN when it is none."""
    at, sign = start, 1.0
    if buffer[at] == _MINUS or buffer[at] == _PLUS:
        sign = -1.0 if buffer[at] == _MINUS else 1.0
        at += 1
    mantissa, digits, decimals, seen_point = np.int64(0), 0, 0, False
    while at < stop and (_ZERO <= buffer[at] <= _NINE or (buffer[at] == _POINT and not seen_point)):
        if buffer[at] == _POINT:
            seen_point = True
        else:
            mantissa = mantissa * 10 + np.int64(buffer[at] - _ZERO)
            digits += 1
            decimals += 1 if seen_point else 0
        at += 1
    if digits == 0 or digits > _MAX_DIGITS:
        return np.nan
    exponent = 0
    if at < stop and (buffer[at] == _BIG_E or buffer[at] == _SMALL_E):
        at += 1
        exponent_sign = 1
        if at < stop and (buffer[at] == _MINUS or buffer[at] == _PLUS):
            exponent_sign = -1 if buffer[at] == _MINUS else 1
            at += 1
        first = at
        while at < stop and _ZERO <= buffer[at] <= _NINE and at - first < 3:
            exponent = exponent * 10 + (buffer[at] - _ZERO)
            at += 1
        if at == first:
            return np.nan
        exponent *= exponent_sign
    if at != stop:
        return np.nan
    # one division by an exact power of ten is correctly rounded, a product with 0.01 is not
    power = exponent - decimals
    return sign * (mantissa * 10.0**power if power >= 0 else mantissa / 10.0**-power)
