"""Labels, file names and captions in many styles -> a few action groups, for colours and for drawing rare ones more."""

import re

# The first row whose pattern is found in the words wins, so narrow groups stand before wide ones.
GROUPS: tuple[tuple[str, str], ...] = (
    ("dance", r"dance\w*|dancing|salsa|indian|ballet|pirouette\w*|arabesque|waltz\w*"),
    ("play ball", r"basketball|soccer|football|dribbl\w*|throw\w*|tennis|golf\w*|juggl\w*|baseball|volleyball"),
    ("kick", r"kick\w*"),
    ("fight", r"sword\w*|shield|slash\w*|punch\w*|stab\w*|parr(?:y|ies)|martial|karate|box(?:es|ing)|fight\w*|atk|kill|"
              r"counter|standoff|taunt|dodg\w*|spar\w*|attack\w*"),
    ("wave", r"wav(?:e|es|ing)|bye|byebye"),
    ("raise hands", r"(?:rais|lift)(?:e|es|ing|s) .*(?:hands?|arms?)|raise"),
    ("sit", r"sit|sits|sitting|seated|stool|chair"),
    ("climb", r"climb\w*|ladder|stairs?"),
    ("floor", r"roll\w*|crawl\w*|cartwheel\w*|\w*flip|handstand|lie|lies|lying|lay|getup|fall|falls|falling|kneel\w*"),
    ("jump", r"jump\w*|leap\w*|hop|hops|hopping|skip\w*"),
    ("squat or bow", r"squat\w*|bow|bows|bowing|crouch\w*|bend|bends|bending|stretch\w*"),
    ("walk and turn", r"(?:walk\w*|step\w*) .*(?:turn\w*|circle\w*|around|curv\w*)"),
    ("walk", r"walk\w*|sneak\w*|stealthy|zombie|stroll\w*|limp\w*|march\w*|stagger\w*|pac(?:es|ing)"),
    ("run", r"run|runs|running|jog\w*|dash\w*|sprint\w*"),
    ("turn", r"turn\w*|spin\w*|rotat\w*|twirl\w*"),
    ("reach", r"grab\w*|deposit\w*|pick\w*|drink\w*|wash\w*|reach\w*|put\w*|place\w*|wip\w*|push\w*|"
              r"pull\w*|open\w*|hold\w*"),
    ("step", r"step\w*|mov(?:e|es|ing)|side"),
    ("gesture", r"guide|call|respond|laugh\w*|point\w*|clap\w*|gestur\w*|shrug\w*|arms?|hands?"),
    ("stand", r"idle|stand\w*|still"),
)  # fmt: skip
_PATTERNS = tuple((name, re.compile(rf"\b(?:{pattern})\b")) for name, pattern in GROUPS)


def words_of(label: str) -> str:
    """'WalkLeft01' and 'walk-left|normal' -> 'walk left': lower-case words, no numbers, no style (after '|')."""
    plain = label.split("|", 1)[0]
    plain = re.sub(r"([a-z])([A-Z])", r"\1 \2", plain)
    return " ".join(re.findall(r"[a-z]+", re.sub(r"(\d+)([a-z])", r"\1 \2", plain).lower()))


def action_of(label: str) -> str:
    """The action group of a label, a file name or a caption; 'other' where no group fits."""
    words = words_of(label)
    return next((name for name, pattern in _PATTERNS if pattern.search(words)), "other")
