"""Prompts of many shapes against what the rules should make of them, and properties that hold for any text."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from playground.errors import PlaygroundError
from playground.limits import LIMITS
from playground.text.clauses import PERSON
from playground.text.english import lexicon
from playground.text.rewriting import Rewritten, by_rules, rewrite

# prompt -> the steps after "a person", and their seconds where the prompt says or implies them (None: the verb's own)
TABLE: list[tuple[str, list[tuple[str, float | None]]]] = [
    ("walk forward", [("walks forward", None)]),
    ("a person walks forward", [("walks forward", None)]),
    ("someone is walking in a circle", [("walks in a circle", None)]),
    ("he's running", [("runs", None)]),
    ("WALK FORWARD!!!", [("walks forward", None)]),
    ("he walks, then sits down", [("walks", None), ("sits down", None)]),
    ("The man jumps twice and then runs away.", [("jumps twice", 2.4), ("runs away", None)]),
    ("walked to the door and knocked on it", [("walks to the door", None), ("knocks on it", None)]),
    ("They are jogging on the spot", [("jogs on the spot", None)]),
    (
        "Please make a person walk to the left for 3 seconds, then sit down for two seconds",
        [("walks to the left", 3.0), ("sits down", 2.0)],
    ),
    ("can you show me a robot dancing", [("dances like a robot", None)]),
    ("I'd like an animation of a boxer punching quickly", [("punches quickly like a boxer", 1.1)]),
    ("I want to see someone crawling on the floor for 5 secs", [("crawls on the floor", 5.0)]),
    ("make a sandwich", [("makes a sandwich", None)]),
    ("make a backflip please", [("does a backflip", None)]),
    ("have a drink", [("has a drink", None)]),
    ("have the man kneel", [("kneels", None)]),
    ("walk and wave", [("walks while waving", None)]),
    ("walks to the table and waves", [("walks to the table", None), ("waves", None)]),
    ("walks forward and sits down", [("walks forward", None), ("sits down", None)]),
    ("walking while waving the right hand", [("walks while waving the right hand", None)]),
    ("a person waves while he is walking", [("waves while walking", None)]),
    ("while walking, she waves", [("waves while walking", None)]),
    ("kick and punch simultaneously", [("kicks while punching", None)]),
    ("raise both arms at the same time as kicking", [("raises both arms while kicking", None)]),
    ("before sitting down, he looks around", [("looks around", None), ("sits down", None)]),
    ("looks around before sitting down", [("looks around", None), ("sits down", None)]),
    ("after walking four steps he turns around", [("walks four steps", 2.8), ("turns around", None)]),
    ("she kicks after spinning around", [("spins around", None), ("kicks", None)]),
    ("keeps jumping until he falls", [("jumps", None), ("falls", None)]),
    ("jump up and down", [("jumps up and down", None)]),
    ("turn left and right", [("turns left and right", None)]),
    ("step to the left and right", [("steps to the left and right", None)]),
    ("walks forward, backward, and to the side", [("walks forward, backward, and to the side", None)]),
    ("walk backwards then forwards", [("walks backwards", None), ("walks forwards", None)]),
    ("1. walk 2. sit 3. stand up", [("walks", None), ("sits", None), ("stands up", None)]),
    ("- squat\n- jump\n- clap three times", [("squats", None), ("jumps", None), ("claps three times", 2.4)]),
    ("walk -> jump → roll", [("walks", None), ("jumps", None), ("rolls", None)]),
    ("wave with both hands; bow; leave", [("waves with both hands", None), ("bows", None), ("leaves", None)]),
    ("crouch/jump", [("crouches", None), ("jumps", None)]),
    ("sit down & stand up", [("sits down", None), ("stands up", None)]),
    (
        "first stretch, second bend over, finally lie down",
        [("stretches", None), ("bends over", None), ("lies down", None)],
    ),
    (
        "gets up, stretches, yawns and goes back to sleep",
        [("gets up", None), ("stretches", None), ("yawns", None), ("goes back to sleep", None)],
    ),
    ("start walking, begin to run and then stop", [("walks", None), ("runs", None), ("stops", None)]),
    ("a person begins by stretching and ends with a bow", [("stretches", None), ("does a bow", None)]),
    ("raises his left arm and lowers it", [("raises the left arm", None), ("lowers it", None)]),
    ("picks up bags and boxes", [("picks up bags and boxes", None)]),
    ("spread your arms, then close them", [("spreads the arms", None), ("closes them", None)]),
    ("backflip", [("does a backflip", None)]),
    ("5 jumping jacks", [("does 5 jumping jacks", 6.0)]),
    ("do ten push-ups", [("does ten push-ups", LIMITS.max_seconds)]),
    ("a jump, a kick and a punch", [("does a jump", None), ("does a kick", None), ("does a punch", None)]),
    ("left kick", [("does a left kick", None)]),
    ("he left the room", [("leaves the room", None)]),
    ("t-pose", [("stands in a t-pose", None)]),
    ("legs apart", [("stands with the legs apart", None)]),
    ("happy walking", [("walks in a happy way", None)]),
    ("moonwalking", [("moonwalks", None)]),
    ("a zombie staggers forward for half a second", [("staggers forward like a zombie", LIMITS.min_seconds)]),
    ("run for a minute", [("runs", LIMITS.max_seconds)]),
    ("waits one second, then sprints for 2-3 seconds", [("waits", 1.0), ("sprints", 2.5)]),
    ("stand still for a while", [("stands still", 4.0)]),
    ("3 seconds of walking, then 2s of sitting", [("walks", 3.0), ("sits", 2.0)]),
    ("run 10 meters", [("runs 10 meters", 3.8)]),
    ("turn 180 degrees to the right", [("turns 180 degrees to the right", 2.0)]),
    ("take three steps back", [("takes three steps back", 2.2)]),
    ("jumps a second time", [("jumps a second time", None)]),
    ("walk slowly", [("walks slowly", 5.6)]),
    ("quickly, carefully sneak past the guard", [("quickly carefully sneaks past the guard", None)]),
    ("the woman in the red dress twirls", [("twirls", None)]),
    ("a person who is holding a box walks up the stairs", [("walks up the stairs while holding a box", None)]),
    ("two people dance a waltz", [("dances a waltz", None)]),
    ("a tall man and a short woman dance", [("dances", None)]),
    ("the person does not move", [("does not move", None)]),
    ("don't move", [("does not move", None)]),
    ("she is happy", [("is happy", None)]),
    ("as the music starts, she dances", [("dances", None)]),
    ("walks as fast as possible", [("walks as fast as possible", None)]),
    (
        "pick up an object from the floor, carry it for 4 steps & put it down",
        [("picks up an object from the floor", None), ("carries it for 4 steps", 2.8), ("puts it down", None)],
    ),
    ("asdf qwer", [("does asdf qwer", None)]),
]


def without_subject(text: str) -> str:
    words = text.split()
    assert "person" in words, text
    return " ".join(words[words.index("person") + 1 :])


@pytest.mark.parametrize(("prompt", "expected"), TABLE, ids=[row[0][:40] for row in TABLE])
def test_prompts_of_many_shapes(prompt, expected):
    made = rewrite(prompt)
    assert [without_subject(step.text) for step in made.steps] == [text for text, _ in expected]
    for step, (_, seconds) in zip(made.steps, expected, strict=True):
        assert seconds is None or step.seconds == pytest.approx(seconds, abs=0.051)
        assert LIMITS.min_seconds <= step.seconds <= LIMITS.max_seconds
    assert made.original == prompt.strip() and made.notes
    assert made.normalised.startswith(("a ", "an "))
    for text in (made.normalised, made.expressive, *(step.text for step in made.steps)):
        assert len(text) <= LIMITS.max_prompt_chars and text == " ".join(text.split())


@pytest.mark.parametrize("prompt", [row[0] for row in TABLE])
def test_what_is_normalised_stays(prompt):
    once = rewrite(prompt)
    again = rewrite(once.normalised)
    assert [step.text for step in again.steps] == [step.text for step in once.steps]


def test_the_table_is_wide_enough():
    assert len({prompt for prompt, _ in TABLE}) >= 60


@pytest.mark.parametrize(
    ("prompt", "subject"),
    [("an old man limps", "an old person"), ("a happy child skips, then sits", "a happy person"), ("he sits", PERSON)],
)
def test_adjectives_of_the_subject_stay_in_every_step(prompt, subject):
    made = rewrite(prompt)
    assert all(step.text.startswith(subject + " ") for step in made.steps)


@pytest.mark.parametrize(
    ("prompt", "note"),
    [
        ("he sits", '"he" told as "a person"'),
        ("please wave", '"please" left out'),
        ("sits before running", '"before" put into the order of time'),
        ("walk and wave", "done at once"),
        ("walk for 3 seconds", "3 s, as the prompt says"),
        ("walk for 30 seconds", "30 s brought to 9.8 s"),
        ("walk four steps", "0.6 s a step"),
        ("asdf", "no verb that is known"),
        ("two people dance", "one person is made"),
        ("the woman in red twirls", "not a part of the motion"),
        ("do not move", "the models have hardly seen it"),
        ("as the music starts, he sits", "not what the person does"),
        ("walks back, then forwards", "the verb before it"),
        ("走路", "English only"),
        ("walking", "third person, present tense"),
    ],
)
def test_notes_say_why(prompt, note):
    assert any(note in line for line in rewrite(prompt).notes), rewrite(prompt).notes


def test_other_languages_are_left_alone():
    made = rewrite("una persona está saltando")
    assert [step.text for step in made.steps] == ["una persona está saltando"]


def test_the_expressive_text_keeps_the_actions_and_adds_to_them():
    for prompt, _ in TABLE:
        made = rewrite(prompt)
        told = made.expressive.lower()
        assert all(without_subject(step.text) in told for step in made.steps)
        assert len(told.split()) > len(made.normalised.split())
    lengths = [len(rewrite(prompt).expressive.split()) for prompt, steps in TABLE if len(steps) in (1, 2)]
    assert 30 < sum(lengths) / len(lengths) < 60


def test_a_long_prompt_still_fits_when_told_expressively():
    prompt = ", then ".join(f"walks {n} steps" for n in range(2, 26))
    made = rewrite(prompt)
    assert len(made.steps) == 24 and len(made.expressive) <= LIMITS.max_prompt_chars


def test_a_speed_that_is_said_is_not_said_again():
    assert "pace" not in rewrite("walks slowly").expressive and "pace" in rewrite("walks").expressive


@pytest.mark.parametrize("prompt", ["", "  ", "...", "?!", "and", "for 3 seconds", "\u200b", "x" * 600])
def test_prompts_without_a_word_are_refused(prompt):
    with pytest.raises(PlaygroundError):
        rewrite(prompt)


@pytest.mark.parametrize("prompt", [None, 3, ["walk"]])
def test_prompts_that_are_no_text_are_refused(prompt):
    with pytest.raises(PlaygroundError, match="text"):
        rewrite(prompt)


WORDS = [
    "walk", "and", "then", ",", "before", "after", "while", "a", "person", "he", "sits", "jumping", "twice", "for",
    "3", "seconds", "the", "left", "not", "please", "make", "as", "-", "|", "(", "'", '"', "is", "to", "with", ".",
    "走",
]  # fmt: skip


@given(st.lists(st.sampled_from(WORDS), max_size=14).map(" ".join) | st.text(max_size=80))
def test_any_text_gives_steps_within_the_limits_or_one_sentence(prompt):
    try:
        made = rewrite(prompt)
    except PlaygroundError:
        return
    assert made == rewrite(prompt) and made.steps
    assert all(LIMITS.min_seconds <= step.seconds <= LIMITS.max_seconds for step in made.steps)
    assert all(step.text.strip() and len(step.text) < 2 * LIMITS.max_prompt_chars for step in made.steps)
    assert 0 < len(made.expressive) <= LIMITS.max_prompt_chars


def test_a_writer_gets_the_clean_prompt_and_the_rules_result():
    seen = []

    def writer(line: str, ruled: Rewritten) -> Rewritten:
        seen.append((line, ruled))
        return ruled

    rewrite("  Walk\u200b  forward ", writer)
    assert seen == [("Walk forward", by_rules("Walk forward"))]


FORMS = [
    ("walk", "walks", "walking", "walked"), ("run", "runs", "running", "ran"), ("sit", "sits", "sitting", "sat"),
    ("carry", "carries", "carrying", "carried"), ("crouch", "crouches", "crouching", "crouched"),
    ("lie", "lies", "lying", "lay"), ("dance", "dances", "dancing", "danced"), ("go", "goes", "going", "went"),
    ("play", "plays", "playing", "played"), ("box", "boxes", "boxing", "boxed"),
    ("tiptoe", "tiptoes", "tiptoeing", None),
    ("be", "is", "being", "was"), ("stop", "stops", "stopping", "stopped"), ("open", "opens", "opening", "opened"),
]  # fmt: skip


@pytest.mark.parametrize("forms", FORMS, ids=[row[0] for row in FORMS])
def test_forms_of_verbs(forms):
    lex = lexicon()
    for kind, form in zip(("third", "gerund", "past"), forms[1:], strict=True):
        if form:
            assert lex.inflect(forms[0], kind) == form
            assert kind == "past" or lex.read(form).lemma == forms[0]


@pytest.mark.parametrize(
    ("word", "lemma"), [("moonwalking", "moonwalk"), ("zigzagging", "zigzag"), ("voguing", "vogue"), ("ceiling", None)]
)
def test_unknown_verbs_are_guessed_from_their_ending(word, lemma):
    form = lexicon().read(word)
    assert (form and form.lemma) == lemma


def test_tables_are_sound():
    lex = lexicon()
    for verb, row in lex.verbs.items():
        assert row["class"] in lex.classes and 0.5 <= lex.seconds(verb) <= LIMITS.max_seconds
    assert all(verb in lex.verbs for verb in lex.doubled) and lex.countable <= set(lex.actions)
