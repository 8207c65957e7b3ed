"""Every limit of the playground, in one table. Nothing else in the code base states one of these numbers."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Limits:
    fps: int = 20  # frame rate of every motion inside the playground
    max_frames: int = 196  # longest motion a tokenizer sees, feature rows at 20 fps (systems.md A1)
    min_frames: int = 16  # shortest motion that is tokenized, feature rows at 20 fps
    min_source_frames: int = 4  # shortest uploaded clip
    max_source_frames: int = 12_000  # longest uploaded clip, frames at its own rate
    max_source_joints: int = 120  # joints of an uploaded skeleton
    max_upload_bytes: int = 20 * 1024 * 1024  # size of an uploaded file, also after decompression of its arrays x8
    max_fps: float = 1_000.0  # frame rate an uploaded file may claim
    max_metres: float = 200.0  # farthest any joint may be from the origin, in metres after unit detection
    max_prompt_chars: int = 500  # characters of a prompt or caption
    max_text_positions: int = 77  # word pieces a text encoder returns (systems.md A5)
    min_seconds: float = 1.0  # shortest generated motion
    max_seconds: float = 9.8  # longest generated motion (196 frames)
    max_seed: int = 2**31 - 1
    max_guidance: float = 6.0  # largest g of the detokenizer, and largest s of the generator
    max_temperature: float = 2.0
    max_json_bytes: int = 2 * 1024 * 1024  # size of a token file
    max_release_bytes: int = 4 * 1024**3  # size of a checkpoint of other authors, training state included
    max_system_bytes: int = 40_000_000  # checkpoints of one shipped system
    max_asset_bytes: int = 150_000_000  # everything that is shipped
    max_figures: int = 6  # figures on one stage
    max_seeds: int = 6  # motions drawn from one prompt at once
    max_listed: int = 64  # neighbours, alternatives or occurrences of a code that are listed
    min_edit_frames: int = 4  # shortest run of frames that is drawn anew, and that must stay
    queue_size: int = 20  # visitors waiting for the model
    sessions: int = 200  # visitors whose open motion is kept in memory
    history: int = 12  # results of a visit that can be brought back
    session_seconds: int = 3_600  # how long it is kept, and an uploaded file too
    deadline_seconds: float = 30.0  # one live request, checked at every scale
    max_link_chars: int = 4_000  # of an address that is read
    max_link_keys: int = 64
    max_picture_side: int = 1_920  # pixels of a rendered picture or film, the longer side
    picture_seconds: float = 120.0  # rendering one picture or film


LIMITS = Limits()
