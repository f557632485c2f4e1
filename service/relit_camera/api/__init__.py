"""REST API and panel: how people and programs change the camera while it runs.

`create_app(camera, settings)` builds the application around anything that implements
`live.camera_control.CameraControl`; `start_api_server` runs it in a thread. A request passes the checks of `middleware`
(origin, token, size) and then one function of `routes`, which asks the scene controller for another scene and answers
with the new state. Nothing here is called by the pipeline, which reads the scene when it needs it. docs/api.md is the
users' page.
"""
