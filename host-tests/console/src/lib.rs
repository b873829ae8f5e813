//! What a person sees of a running board: its log decoded, a status line a second.
