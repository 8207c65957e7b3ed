"""The rooms of the app, in the order of their tabs. Each module has `room(services)`, which builds its room."""

from collections.abc import Callable

from playground.ui.rooms import codebooks, compare, edit, embedding, endless, generate, guidance, learn, tokenize
from playground.ui.services import Services

ROOMS: dict[str, Callable[[Services], None]] = {
    "Tokenize": tokenize.room,
    "Embedding map": embedding.room,
    "Codebooks": codebooks.room,
    "Generate": generate.room,
    "Guidance": guidance.room,
    "Edit": edit.room,
    "Endless": endless.room,
    "Compare": compare.room,
    "Learn": learn.room,
}
