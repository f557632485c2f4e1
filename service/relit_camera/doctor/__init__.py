"""`relit doctor`: finds what prevents the camera from working on this machine, and says what to do about it.

Advice on packages and kernel modules is here only: errors elsewhere refer to `relit doctor`.
"""
