from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.generators.hierarchical import HierarchicalGenerator
from playground.generators.streaming import Overlap, Stream, WindowDecoder
from playground.nn.sampling import Sampling
from playground.tokenizers.base import Tokens
from playground.tokenizers.convolutional import CONV_PRESETS, ConvTokenizer, build_conv
from tests.generators.lookup import row_of
from tests.generators.test_hierarchical import LEVELS, tiny
from tests.tiny import text_features

GENERATOR = tiny()  # a window of 12 steps
WORDS = [text_features((3,), seed=n) for n in range(3)]
DRAW = Sampling(seed=4, cfg=1.0, top_k=1.0, top_p=1.0)


def ids_of(stream: Stream, *parts: int) -> torch.Tensor:
    """[N, B, T] of several calls."""
    return torch.cat([torch.stack(stream.next(part)) for part in parts], dim=-1)


def tiny_conv(**changes) -> ConvTokenizer:
    """Its decoder sees less than 8 steps to either side."""
    config = replace(
        CONV_PRESETS["momask"], max_frames=48, width=8, blocks=1, dropout=0.0, code_width=6, codes=(10,) * LEVELS,
        divisors=(1,) * LEVELS, **changes,
    )  # fmt: skip
    with torch.random.fork_rng():
        torch.manual_seed(2)
        tokenizer = build_conv(config).eval().requires_grad_(False)
        for book in tokenizer.quantizer.codebooks:
            book.vectors.normal_()
    return tokenizer


def some_ids(steps: int, seed: int = 0) -> torch.Tensor:
    return torch.randint(10, (LEVELS, 1, steps), generator=torch.Generator().manual_seed(seed))


def whole(tokenizer: ConvTokenizer, ids: torch.Tensor) -> torch.Tensor:
    lengths = torch.tensor([ids.shape[-1] * 4])
    embedding = tokenizer.embed(Tokens(tuple(ids), (10,) * LEVELS), lengths=lengths)
    return tokenizer.decode(embedding, lengths, None)


@pytest.mark.parametrize("cfg", [0.0, 1.0])
def test_a_stream_is_one_shot_generation_while_the_history_fits(cfg):
    draw = replace(DRAW, cfg=cfg)
    made = GENERATOR.generate(WORDS[0], torch.tensor([48]), draw).tokens
    assert torch.equal(ids_of(Stream(GENERATOR, WORDS[0], draw), 12), torch.stack(made.ids))
    longer = GENERATOR.generate(WORDS[0], torch.tensor([160]), draw).tokens  # by the same rule beyond it
    assert torch.equal(ids_of(Stream(GENERATOR, WORDS[0], draw), 7, 33), torch.stack(longer.ids))


@settings(max_examples=8, deadline=None)
@given(parts=st.lists(st.integers(0, 9), min_size=1, max_size=5))
def test_what_is_drawn_does_not_depend_on_how_much_is_asked_for_at_once(parts):
    stream = Stream(GENERATOR, WORDS[0], DRAW)
    assert torch.equal(ids_of(stream, *parts), ids_of(Stream(GENERATOR, WORDS[0], DRAW), sum(parts)))
    assert stream.drawn == sum(parts)


@settings(max_examples=5, deadline=None)
@given(
    before=st.lists(st.tuples(st.integers(1, 9), st.integers(0, 2)), max_size=2),
    carry=st.sampled_from([None, 0, 3, 99]),
)
def test_a_switch_leaves_earlier_tokens_untouched_and_is_repeatable(before, carry):
    def run(switched: bool) -> torch.Tensor:
        stream, parts = Stream(GENERATOR, WORDS[0], DRAW), []
        for steps, words in before:
            parts.append(torch.stack(stream.next(steps)))
            stream.switch(WORDS[words])
        parts.append(torch.stack(stream.next(4)))
        if switched:
            stream.switch(text_features((2,), seed=9), carry)
        return torch.cat([*parts, torch.stack(stream.next(9))], dim=-1)

    plain, switched = run(False), run(True)
    count = sum(steps for steps, _ in before) + 4
    assert torch.equal(plain[..., :count], switched[..., :count])
    assert plain.shape == switched.shape
    assert torch.equal(switched, run(True))


def test_the_text_of_a_switch_matters():
    def run(words: int) -> torch.Tensor:
        stream = Stream(GENERATOR, WORDS[0], replace(DRAW, temperature=0.0))
        stream.next(6)
        stream.switch(WORDS[words])
        return ids_of(stream, 12)

    assert len({tuple(run(words).flatten().tolist()) for words in range(3)}) > 1


def test_a_switch_acts_from_the_next_step_with_the_history_it_carries():
    stream = Stream(GENERATOR, WORDS[0], replace(DRAW, temperature=0.0, cfg=0.0))
    past = ids_of(stream, 6)
    for carry, seen in ((None, past), (2, past[..., -2:]), (0, past[..., :0])):
        stream = Stream(GENERATOR, WORDS[0], replace(DRAW, temperature=0.0, cfg=0.0))
        stream.next(6)
        stream.switch(WORDS[1], carry)
        new = torch.stack(stream.next(1))
        joined = torch.cat([seen, new], dim=-1)
        logits = GENERATOR.logits(Tokens(tuple(joined), (10,) * LEVELS), WORDS[1], torch.tensor([4]))
        assert [part[0, -1].argmax() for part in logits] == list(new[:, 0, 0])


def test_rows_of_a_batch_stream_as_they_do_alone():
    both = text_features((4, 2))
    batch = ids_of(Stream(GENERATOR, both, Sampling(seeds=(3, 8), top_k=1.0), rows=2), 20)
    for row, seed in enumerate((3, 8)):
        alone = ids_of(Stream(GENERATOR, row_of(both, row), Sampling(seed=seed, top_k=1.0)), 20)
        assert torch.equal(batch[:, row], alone[:, 0])


def test_memory_does_not_grow_with_the_number_of_steps():
    stream, decoder = Stream(GENERATOR, WORDS[0], DRAW), WindowDecoder(tiny_conv(), Overlap(8, 4, 2))
    sizes = []
    for turn in range(40):
        decoder.push(stream.next(3))
        if turn % 20 == 5:
            stream.switch(WORDS[turn % 3])
        sizes.append(stream.held() + decoder.held())
    assert max(sizes[8:]) == max(sizes[24:]) > 0  # 120 steps; a window holds 12
    assert len(stream._ready) == 0


def test_a_check_that_raises_loses_nothing():
    calls: list[int] = []

    def check():
        calls.append(1)
        if len(calls) == 4:
            raise PlaygroundError("stop")

    stream = Stream(GENERATOR, WORDS[0], DRAW)
    with pytest.raises(PlaygroundError, match="stop"):
        stream.next(6, check)
    assert torch.equal(ids_of(stream, 2, 4), ids_of(Stream(GENERATOR, WORDS[0], DRAW), 6))
    with pytest.raises(PlaygroundError, match="stop"):
        calls[:] = [1, 1, 1]
        Stream(GENERATOR, WORDS[0], replace(DRAW, check=check)).next(1)


@settings(max_examples=8, deadline=None)
@given(parts=st.lists(st.integers(0, 9), min_size=1, max_size=6), fade=st.integers(0, 3))
def test_windows_that_reach_far_enough_give_one_decode_of_everything(parts, fade):
    tokenizer, ids = tiny_conv(), some_ids(sum(parts))
    decoder = WindowDecoder(tokenizer, Overlap(8, 8 + fade, fade))
    assert decoder.unit == 4
    done = [decoder.push(part) for part in ids.split(parts, dim=-1)]
    assert sum(rows.shape[1] for rows in done) == 4 * max(0, sum(parts) - 8 - fade)
    joined = torch.cat([*done, decoder.finish()], dim=1)
    if sum(parts):
        torch.testing.assert_close(joined, whole(tokenizer, ids), atol=1e-5, rtol=1e-4)


def test_the_first_rows_of_a_window_fade_over_from_the_window_before():
    tokenizer, ids = tiny_conv(), some_ids(12)
    decoder = WindowDecoder(tokenizer, Overlap(2, 3, 2))
    first, second, third = (decoder.push(part) for part in ids.split((5, 5, 2), dim=-1))
    one, two, three = whole(tokenizer, ids[..., :5]), whole(tokenizer, ids[..., :10]), whole(tokenizer, ids[..., 5:])
    assert torch.equal(first, one[:, :8])  # tokens 0 and 1
    share = (torch.arange(8) + 1)[:, None] / 9
    torch.testing.assert_close(second[:, :8], one[:, 8:16] * (1 - share) + two[:, 8:16] * share)
    torch.testing.assert_close(second[:, 8:], two[:, 16:28])  # tokens 4 to 6
    torch.testing.assert_close(third, two[:, 28:36] * (1 - share) + three[:, 8:16] * share)  # 5 and 6 stay in sight
    assert (one[:, 8:16] - two[:, 8:16]).abs().max() > 1e-3


@pytest.mark.parametrize("overlap", [Overlap(0, 4, 2), Overlap(8, 2, 3), Overlap(8, 2, -1)])
def test_windows_that_make_no_sense_are_refused(overlap):
    with pytest.raises(ValueError, match="overlap"):
        WindowDecoder(tiny_conv(), overlap)


def test_the_generator_of_the_stream_keeps_nothing_of_it():
    before = GENERATOR.generate(WORDS[0], torch.tensor([24]), DRAW).tokens
    ids_of(Stream(GENERATOR, WORDS[1], DRAW), 30)
    assert isinstance(GENERATOR, HierarchicalGenerator)
    assert GENERATOR.generate(WORDS[0], torch.tensor([24]), DRAW).tokens == before
