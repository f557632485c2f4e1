"""Expression stills beside the running camera: filming with prompts, videos that are sent, and the worker process."""
