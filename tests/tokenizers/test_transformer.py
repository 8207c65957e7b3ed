import itertools
from dataclasses import replace

import pytest
import torch

from playground.text.encoders import TextFeatures
from playground.tokenizers.transformer import PRESETS, build_tokenizer, length_mask, linear_codes
from tests.tiny import TINY, text_features, tiny_tokenizer

LENGTHS = torch.tensor([40, 24])


def motion(frames: int = 40, batch: int = 2, seed: int = 0) -> torch.Tensor:
    x = torch.randn(batch, frames, 67, generator=torch.Generator().manual_seed(seed))
    mask = length_mask(LENGTHS[:batch], frames)
    return x if mask is None else x * mask[..., None]


def row(text: TextFeatures, index: int) -> TextFeatures:
    """One text alone, without padding."""
    count = int(text.mask[index].sum())
    only = slice(index, index + 1)
    return TextFeatures(text.tokens[only, :count], text.mask[only, :count], text.pooled[only], text.words[only])


@pytest.mark.parametrize("aligned", [False, True])
@pytest.mark.parametrize("patch", [1, 4])
def test_padding_changes_nothing(patch, aligned):
    model, text = tiny_tokenizer(patch=patch, aligned=aligned), text_features((4, 2))
    x = motion()
    together = model.latents(x, LENGTHS, text)
    alone = model.latents(x[1:, :24], LENGTHS[1:], row(text, 1))
    torch.testing.assert_close(together[1:], alone, atol=1e-5, rtol=1e-4)
    longer = TextFeatures(
        torch.cat([text.tokens, torch.randn(2, 9, 20)], 1),
        torch.cat([text.mask, torch.zeros(2, 9, dtype=torch.bool)], 1),
        text.pooled,
        text.words,
    )
    torch.testing.assert_close(model.latents(x, LENGTHS, longer), together, atol=1e-5, rtol=1e-4)
    z = torch.randn(2, 6, 12)
    out = model.decode(z, LENGTHS, text)
    assert out.shape == (2, 40, 67) and torch.equal(out[1, 24:], torch.zeros(16, 67))
    torch.testing.assert_close(out[1:, :24], model.decode(z[1:], LENGTHS[1:], row(text, 1)), atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(model.decode(z, LENGTHS, longer), out, atol=1e-5, rtol=1e-4)


@pytest.mark.parametrize("aligned", [False, True])
def test_guidance_equals_two_plain_decodes(aligned):
    model, text, z = tiny_tokenizer(aligned=aligned), text_features((4, 2)), torch.randn(2, 6, 12)
    conditional, unconditional = model.decode(z, LENGTHS, text), model.decode(z, LENGTHS, None)
    assert (conditional - unconditional).abs().max() > 1e-2
    for g in (0.0, 0.5, 2.0, 6.0):
        expected = (1 + g) * conditional - g * unconditional
        torch.testing.assert_close(model.decode(z, LENGTHS, text, g), expected, atol=1e-4, rtol=1e-4)
    for ours, plain in zip(model.branches(z, LENGTHS, text), (conditional, unconditional), strict=True):
        torch.testing.assert_close(ours, plain, atol=1e-5, rtol=1e-4)


def test_null_text_does_not_depend_on_the_number_of_words():
    """A5: the null branch attends to n copies of one vector, so n does not matter."""
    model, z = tiny_tokenizer(), torch.randn(2, 6, 12)
    for lengths in ((1, 1), (7, 3)):
        dropped = torch.ones(2, dtype=torch.bool)
        memory = model._memory(2, text_features(lengths), dropped)
        out = model._detokenize(z, LENGTHS, memory)
        torch.testing.assert_close(out, model.decode(z, LENGTHS, None), atol=1e-5, rtol=1e-4)


def test_dropped_language_equals_no_language_in_the_tokenizer():
    model, x = tiny_tokenizer(), motion()
    dropped = model.latents(x, LENGTHS, text_features((4, 2)), torch.tensor([True, False]))
    torch.testing.assert_close(dropped[:1], model.latents(x[:1], LENGTHS[:1], None), atol=1e-5, rtol=1e-4)
    with_text = model.latents(x, LENGTHS, text_features((4, 2)))
    torch.testing.assert_close(dropped[1:], with_text[1:], atol=1e-5, rtol=1e-4)
    assert (dropped[0] - with_text[0]).abs().max() > 1e-3


@pytest.mark.parametrize("patch", [1, 4])
def test_edit_mask_of_ones_is_the_plain_decode_bit_for_bit(patch):
    model, text, z = tiny_tokenizer(patch=patch), text_features((4, 2)), torch.randn(2, 6, 12)
    everywhere = torch.ones(2, 40, dtype=torch.bool)
    assert torch.equal(model.decode(z, LENGTHS, text, 0.0, everywhere), model.decode(z, LENGTHS, text))
    nowhere, other = torch.zeros_like(everywhere), text_features((4, 2), seed=9)
    same = model.decode(z, LENGTHS, text, 2.0, nowhere), model.decode(z, LENGTHS, other, 2.0, nowhere)
    assert torch.equal(*same)


def test_aligned_latents_are_spread_evenly_over_each_motion():
    """Latent t of T stands in the middle of the t-th of T equal parts of the motion; frames stand at 0, 1, 2, ..."""
    places = tiny_tokenizer(aligned=True)._latent_places(LENGTHS)
    for b, length in enumerate(LENGTHS.tolist()):
        edges = [t * length / 6 - 0.5 for t in range(7)]
        middles = [(first + last) / 2 for first, last in itertools.pairwise(edges)]
        torch.testing.assert_close(places[b], torch.tensor(middles))
    with pytest.raises(ValueError, match="rotary"):
        tiny_tokenizer(aligned=True, positions="learned")


SWITCHES = {
    "aligned": [True],
    "small_init": [False],
    "norm": ["layer"],
    "feed": ["gelu"],
    "skips": [False],
    "positions": ["learned"],
    "rope_base": [10.0, 1000.0, 10_000.0],
    "pre_norm": [True],
    "text_side": ["tokenizer", "detokenizer", "none"],
    "metric": ["euclidean"],
    "phi": ["residual", "identity"],
}
MIXES = ("text_mixing", "motion_mixing", "text_mixing_out", "latent_mixing_out")


@pytest.mark.parametrize(("name", "value"), [(n, v) for n, values in SWITCHES.items() for v in values])
def test_every_switch_of_the_ablations_changes_the_result(name, value):
    model, plain = tiny_tokenizer(**{name: value}), tiny_tokenizer()
    x, text = motion(), text_features((4, 2))
    out = model.decode(model.encode(x, LENGTHS, text).embedding, LENGTHS, text)
    assert out.shape == x.shape and torch.isfinite(out).all()
    assert not torch.equal(out, plain.decode(plain.encode(x, LENGTHS, text).embedding, LENGTHS, text))


@pytest.mark.parametrize("mix", list(itertools.product(["in-context", "cross"], repeat=4)))
def test_every_mix_of_table_4g_runs_and_masks_padding(mix):
    model = tiny_tokenizer(**dict(zip(MIXES, mix, strict=True)))
    x, text = motion(), text_features((4, 2))
    z = model.latents(x, LENGTHS, text)
    torch.testing.assert_close(z[1:], model.latents(x[1:, :24], LENGTHS[1:], row(text, 1)), atol=1e-5, rtol=1e-4)
    quantized = model.quantizer.encode(z)
    out = model.decode(quantized.embedding, LENGTHS, text, 2.0)
    alone = model.decode(quantized.embedding[1:], LENGTHS[1:], row(text, 1), 2.0)
    torch.testing.assert_close(out[1:, :24], alone, atol=1e-4, rtol=1e-3)
    assert model.latents(x, LENGTHS, None).shape == z.shape


@pytest.mark.parametrize(("side", "encodes", "decodes"), [("tokenizer", 1, 0), ("detokenizer", 0, 1), ("none", 0, 0)])
def test_text_acts_only_on_the_side_it_is_given_to(side, encodes, decodes):
    model, x = tiny_tokenizer(text_side=side), motion()
    first, second = text_features((4, 2), seed=1), text_features((4, 2), seed=2)
    assert (not torch.equal(model.latents(x, LENGTHS, first), model.latents(x, LENGTHS, second))) == bool(encodes)
    z = torch.randn(2, 6, 12)
    assert (not torch.equal(model.decode(z, LENGTHS, first), model.decode(z, LENGTHS, second))) == bool(decodes)


def test_training_pass_reaches_every_parameter():
    model = build_tokenizer(TINY).train()
    out = model(motion(), LENGTHS, text_features((4, 2)), torch.tensor([False, True]))
    (out.features.square().sum() + out.commitment).backward()
    silent = [name for name, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum()]
    assert not silent
    assert [tuple(ids.shape) for ids in out.ids] == [(2, 1), (2, 3), (2, 6)]


def test_a_learned_word_table_reads_numbers():
    model, x = tiny_tokenizer(text_table=9, text_width=1), motion()
    numbers = torch.tensor([[3.0, 7.0, 3.0, 0.0], [7.0, 0.0, 0.0, 0.0]])[..., None]
    mask = torch.tensor([[True] * 4, [True, False, False, False]])
    text = TextFeatures(numbers, mask, numbers.mean(dim=1), [["a"] * 4, ["b"]])
    states = model.text_proj(numbers)
    assert torch.equal(states[0, 0], states[0, 2]) and torch.equal(states[0, 1], states[1, 0])
    assert not torch.equal(states[0, 0], states[0, 1])
    other = TextFeatures(numbers + 1, mask, text.pooled, text.words)
    assert not torch.equal(model.latents(x, LENGTHS, text), model.latents(x, LENGTHS, other))
    trained = build_tokenizer(replace(TINY, text_table=9, text_width=1)).train()
    trained(x, LENGTHS, text).features.square().sum().backward()
    touched = trained.text_proj.vectors.weight.grad.abs().sum(dim=1) > 0
    assert touched.nonzero()[:, 0].tolist() == [0, 3, 7]


def test_presets_hold_the_published_numbers():
    assert linear_codes(256, 768, 10) == (256, 313, 370, 427, 484, 540, 597, 654, 711, 768)
    sums = {name: sum(PRESETS[name].scales) for name in ("full", "mid", "mini")}
    assert sums == {"full": 236, "mid": 160, "mini": 104}
    rvq = PRESETS["rvq"]
    assert (rvq.scales, rvq.codes, rvq.draw, rvq.level_drop, rvq.phi) == ((49,) * 6, (512,) * 6, 0.5, 0.2, "identity")
    assert PRESETS["tiny"].depth == 3 and PRESETS["full"].depth == 9


def test_full_size_has_the_parameters_counted_on_the_released_code():
    """A7: tokenizer stack 10,408,704; detokenizer stack 15,200,067; phi 15,738,880; text 524,544; vectors 12,800."""
    model = build_tokenizer(PRESETS["full"])

    def count(*parts: object) -> int:
        return sum(p.numel() for part in parts for p in part.parameters())  # type: ignore[attr-defined]

    assert count(model.text_proj) == 524_544
    assert sum(count(phi) for phi in model.quantizer.phis) == 15_738_880
    assert model.latent_tokens.numel() + model.mask_vector.numel() == 12_800
    assert sum(p.numel() for p in model.parameters()) == pytest.approx(41.88e6, rel=0.002)


def test_even_depth_with_skips_is_refused():
    with pytest.raises(ValueError, match="odd depth"):
        tiny_tokenizer(depth=4)
