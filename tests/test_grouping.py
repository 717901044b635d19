"""Grouping of synthetic maps."""

from __future__ import annotations

import numpy as np
import pytest

from scpf.models.grouping import (
    CENTRE_CELL_PX,
    OFFSET_CELL_PX,
    OFFSET_SCALE_PX,
    Candidate,
    Form,
    ScoreCalibration,
    group,
)

HEIGHT, WIDTH = 256, 192
Maps = tuple[np.ndarray, np.ndarray, np.ndarray]


def pole_maps(poles: list[tuple[int, int, int, int]], peaks: list[float]) -> Maps:
    """What a perfect network would say about upright poles (x1, x2, y1, y2), with these centre peaks."""
    mask = np.full((HEIGHT, WIDTH), 0.01, np.float32)
    centre = np.zeros((HEIGHT // CENTRE_CELL_PX, WIDTH // CENTRE_CELL_PX), np.float32)
    offsets = np.zeros((2, HEIGHT // OFFSET_CELL_PX, WIDTH // OFFSET_CELL_PX), np.float32)
    for (x1, x2, y1, y2), peak in zip(poles, peaks, strict=True):
        mask[y1:y2, x1:x2] = 0.95
        middle = ((x1 + x2) / 2, (y1 + y2) / 2)
        centre[int(middle[1] // CENTRE_CELL_PX), int(middle[0] // CENTRE_CELL_PX)] = peak
        rows = np.arange(y1 // OFFSET_CELL_PX, -(-y2 // OFFSET_CELL_PX))
        columns = np.arange(x1 // OFFSET_CELL_PX, -(-x2 // OFFSET_CELL_PX))
        for axis, cells in enumerate((columns[None, :], rows[:, None])):
            aim = (middle[axis] - (cells + 0.5) * OFFSET_CELL_PX) / OFFSET_SCALE_PX[axis]
            offsets[axis, rows[:, None], columns[None, :]] = aim
    return mask, centre, offsets


def test_two_poles_side_by_side_stay_two() -> None:
    poles = [(40, 46, 20, 220), (60, 66, 30, 230)]
    found = group(*pole_maps(poles, [0.6, 0.9]))
    assert [c.centre for c in found] == pytest.approx([0.9, 0.6])
    for candidate, (x1, x2, y1, y2) in zip(found, reversed(poles), strict=True):
        rows, columns = np.nonzero(candidate.mask)
        left, top = candidate.corner_px
        assert (columns.min() + left, columns.max() + left + 1) == (x1, x2)
        assert (rows.min() + top, rows.max() + top + 1) == (y1, y2)
        assert candidate.mask_mean == pytest.approx(0.95)


def test_the_soft_mask_holds_no_pixel_of_the_neighbour() -> None:
    found = group(*pole_maps([(40, 44, 20, 220), (46, 50, 30, 200)], [0.9, 0.5]))
    for candidate in found:
        assert not (candidate.soft > 0.5)[~candidate.mask].any()


def test_pixels_that_point_elsewhere_belong_to_nobody() -> None:
    mask, centre, offsets = pole_maps([(40, 46, 20, 220)], [0.9])
    mask[20:220, 150:156] = 0.95  # no centre, offsets 0: they point at themselves
    (only,) = group(mask, centre, offsets)
    assert only.corner_px[0] + only.mask.shape[1] < 60


def test_scraps_are_left_out_and_the_parts_of_a_hidden_pole_are_kept() -> None:
    mask, centre, offsets = pole_maps([(40, 46, 20, 220)], [0.9])
    mask[100:140, 38:48] = 0.01  # something stands before it
    mask[60:64, 56:60] = 0.95
    offsets[0, 15, 14] = (43 - 58) / OFFSET_SCALE_PX[0]
    offsets[1, 15, 14] = (120 - 62) / OFFSET_SCALE_PX[1]
    (only,) = group(mask, centre, offsets)
    assert only.mask.sum() == 6 * 160


@pytest.mark.parametrize("peaks", [[0.0], [0.05]])
def test_nothing_without_a_peak(peaks: list[float]) -> None:
    assert group(*pole_maps([(40, 46, 20, 220)], peaks)) == []


def test_calibration_is_a_probability_that_grows_with_the_evidence() -> None:
    calibration = ScoreCalibration(1.2, 0.8, 0.3, 0.5, -2.0, 0.6)

    def score(centre: float, height_px: int, width_px: int) -> float:
        mask = np.ones((height_px, width_px), bool)
        return calibration.probability(Candidate((0, 0), mask.astype(np.float32), mask, centre, 0.9))

    scores = [score(p, 100, 4) for p in (0.0, 0.2, 0.5, 0.9, 1.0)]
    assert scores == sorted(scores)
    assert 0 < scores[0] < scores[-1] < 1
    assert score(0.5, 100, 8) < score(0.5, 100, 4) < score(0.5, 200, 4)


def test_rows_in_which_a_pole_is_hidden_do_not_make_it_slimmer() -> None:
    mask = np.ones((100, 6), bool)
    mask[30:60] = False
    assert Form.of(mask) == (100, 6.0, 1.0)


def test_a_lamp_is_wider_at_its_head() -> None:
    mask = np.zeros((160, 30), bool)
    mask[:, 2:6] = True
    mask[:10] = True  # half of the first eighth
    lamp = Candidate((0, 0), mask.astype(np.float32), mask, 0.9, 0.9)
    form, upside_down_form = Form.of(mask), Form.of(mask[::-1])
    assert form.head == pytest.approx(((30 + 4) / 2) / form.width_px)
    upside_down = lamp._replace(mask=mask[::-1])
    calibration = ScoreCalibration(1.0, 1.0, 0.5, -1.0, -0.5, 0.6)
    assert upside_down_form.head < 1 < form.head
    assert calibration.probability(upside_down) < calibration.probability(lamp)


@pytest.mark.parametrize(
    ("poles", "count"),
    [
        ([(40, 46, 20, 120), (40, 46, 120, 220)], 1),  # two centres on one pole
        ([(40, 46, 120, 220), (42, 48, 20, 120)], 1),  # a little aslant, and the higher peak below
        ([(40, 46, 20, 100), (42, 48, 140, 220)], 1),  # something stands before its middle
        ([(40, 46, 20, 120), (56, 62, 120, 220)], 2),  # not in one line
        ([(40, 46, 20, 220), (60, 66, 60, 230)], 2),  # side by side
        ([(40, 70, 20, 120), (52, 58, 120, 220)], 2),  # a trunk on a pole
        ([(40, 46, 20, 60), (40, 46, 160, 220)], 2),  # too far apart for so short a part
    ],
)
def test_parts_in_one_line_are_one_pole(poles: list[tuple[int, int, int, int]], count: int) -> None:
    found = group(*pole_maps(poles, [0.9, 0.6]))
    assert len(found) == count
    if count == 1:
        assert found[0].centre == pytest.approx(0.9)
        assert Form.of(found[0].mask).height_px == max(y2 for *_, y2 in poles) - min(
            y1 for _, _, y1, _ in poles
        )
        assert found[0].mask.sum() == sum((x2 - x1) * (y2 - y1) for x1, x2, y1, y2 in poles)


def test_three_parts_are_one_pole_in_any_order_of_their_peaks() -> None:
    parts = [(40, 46, 20, 80), (40, 46, 80, 150), (40, 46, 150, 220)]
    for peaks in ([0.9, 0.6, 0.7], [0.6, 0.9, 0.7], [0.7, 0.6, 0.9]):
        (whole,) = group(*pole_maps(parts, peaks))
        assert Form.of(whole.mask).height_px == 200 and whole.centre == pytest.approx(0.9)


def test_peaks_on_one_wide_pole_are_one_however_their_parts_are_cut() -> None:
    mask, centre, offsets = pole_maps([(40, 72, 10, 250)], [0.9])
    centre[6, 6] = 0.8  # a second peak above the first, 9 cells away
    rows = np.arange(offsets.shape[1])[:, None]
    columns = np.arange(offsets.shape[2])[None, :]
    upper = rows < 30 + 2 * (columns - 14)  # aslant across the pole: the parts share many rows
    aim = ((56 - (columns + 0.5) * OFFSET_CELL_PX) / 32, (52 - (rows + 0.5) * OFFSET_CELL_PX) / 64)
    for axis in (0, 1):
        offsets[axis] = np.where(upper, aim[axis], offsets[axis])
    (whole,) = group(mask, centre, offsets)
    assert whole.mask.sum() == 32 * 240


def test_a_few_pixels_that_a_second_peak_takes_from_a_pole_are_the_poles() -> None:
    mask, centre, offsets = pole_maps([(40, 52, 10, 250)], [0.9])
    centre[25, 5] = 0.8  # on the pole, 72 px below its centre
    rows, columns = np.arange(25, 31), 10  # a third of its width, in rows that it has, too
    aim = ((44 - (columns + 0.5) * OFFSET_CELL_PX) / 32, (204 - (rows + 0.5) * OFFSET_CELL_PX) / 64)
    for axis in (0, 1):
        offsets[axis, rows, columns] = aim[axis]
    (whole,) = group(mask, centre, offsets)
    assert whole.mask.sum() == 12 * 240 and whole.centre == pytest.approx(0.9)
