import torch

from playground.nn.positions import sinusoid


def test_sinusoid_matches_the_formula():
    table = sinusoid(torch.arange(5), 6)
    angle = torch.tensor(4.0) / 10_000 ** (torch.tensor([0.0, 2.0, 4.0]) / 6)
    torch.testing.assert_close(table[4, 0::2], angle.sin())
    torch.testing.assert_close(table[4, 1::2], angle.cos())


def test_a_number_stands_for_that_many_positions_and_rows_may_differ():
    assert torch.equal(sinusoid(7, 8), sinusoid(torch.arange(7), 8))
    rows = torch.tensor([[0.0, 1.5], [3.0, 2.0]])
    assert torch.equal(sinusoid(rows, 4)[1], sinusoid(rows[1], 4))
