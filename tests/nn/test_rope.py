import cmath

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.nn.rope import apply_rope, rope_angles


def slow_rope(vector: list[float], position: float, base: float) -> list[float]:
    """Pairs (2i, 2i+1) as complex numbers, turned by position * base^(-2i / width)."""
    width = len(vector)
    out = []
    for i in range(0, width, 2):
        turned = complex(vector[i], vector[i + 1]) * cmath.exp(1j * position * base ** (-i / width))
        out += [turned.real, turned.imag]
    return out


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-3, 3, width=32), min_size=8, max_size=8),
    st.floats(0, 322),
    st.sampled_from([10.0, 100.0, 1000.0, 10_000.0]),
)
def test_rotation_equals_complex_multiplication(vector, position, base):
    x = torch.tensor(vector, dtype=torch.float32).view(1, 1, 1, 8)
    rotated = apply_rope(x, rope_angles(torch.tensor([position]), 8, base)).flatten()
    torch.testing.assert_close(rotated, torch.tensor(slow_rope(vector, position, base)), atol=2e-4, rtol=1e-3)


def test_scores_depend_on_the_distance_alone():
    rng = torch.Generator().manual_seed(0)
    query, key = torch.randn(2, 1, 1, 1, 16, generator=rng)

    def score(i: float, j: float) -> float:
        turn = [apply_rope(v, rope_angles(torch.tensor([p]), 16, 100.0)) for v, p in ((query, i), (key, j))]
        return float((turn[0] * turn[1]).sum())

    assert abs(score(3, 10) - score(103, 110)) < 1e-4
    assert abs(score(3, 10) - score(3, 12)) > 1e-3
