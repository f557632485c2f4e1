"""The configuration: a pydantic model a topic, with meaning, range and default of every field.

`look` holds what changes while the camera runs (lighting, background, mode), `settings` what is fixed for a run;
`settings_loader` reads YAML file, environment and command line; `config_watcher` notices edits of the file.
"""
