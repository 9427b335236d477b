"""Where a person saw the ego lane's paint: in photograph → row v → column u of the left and of the right line, read off
eight-fold enlargements to about a pixel. Null where there is a gap, or a reflector instead of paint."""

from __future__ import annotations

from tests.accuracy.lane_images import Marks

MARKS: Marks = {
    "solidWhiteCurve": {348: (429.5, 548.6), 381: (386.9, 607.6), 461: (286.6, 750.6)},
    "solidWhiteRight": {345: (427.3, 539.6), 393: (358.3, 614.5), 424: (315.4, None), 465: (None, 725.5)},
    "solidYellowCurve": {348: (425.4, 538.9), 392: (366.7, 612.0), 465: (262.9, None), 491: (None, 771.8)},
    "solidYellowCurve2": {346: (428.5, 542.0), 397: (357.4, None), 465: (263.9, 736.0)},
    "whiteCarLaneSwitch": {349: (434.3, 549.5), 381: (390.4, 604.0), 466: (280.3, 750.1)},
    "straight_lines2": {465: (574.0, 710.8), 512: (506.5, 786.0), 618: (359.3, 951.6)},
    "test1": {478: (567.3, 754.0), 489: (549.8, 771.0), 645: (344.5, 1033.0)},
    "test2": {465: (568.3, 703.6), 514: (523.9, 805.9), 633: (390.1, 995.4)},
    "test3": {460: (612.5, 731.4), 514: (526.5, None), 618: (374.5, 977.3)},
    "test4": {465: (None, 736.2), 468: (582.0, None), 517: (521.0, 819.6), 619: (390.2, 997.3)},
    "test6": {465: (606.8, 742.3), 517: (528.6, 827.0), 581: (None, 929.1), 618: (391.0, None)},
}
