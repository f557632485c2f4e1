"""Routes of work that goes on after the answer: captures and replays."""
