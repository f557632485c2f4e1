#!/bin/sh
# shellcheck disable=SC2016  # what is quoted is run by another shell
# Run by the bare machine as root: the README's commands, as the person `you` would type them, each timed.
# Given in /host: checkout (a bare repository), models (a folder, if the networks cannot be fetched from their authors).
set -u

began=$(date +%s)
# step TITLE COMMAND: in a new login of `you`. Its output is kept; a failure ends the trial.
step() {
    start=$(date +%s)
    printf '%s\n' "$2" >/tmp/command
    chmod 644 /tmp/command
    runuser -l you -c "set -e; cd ~; . /tmp/command" >>"/host/output.txt" 2>&1
    status=$?
    printf '%s\t%s\t%s\t%s\n' "$(($(date +%s) - start))" "$status" "$1" "$(printf '%s' "$2" | tr '\n\t' ';  ')" >>/host/steps.tsv
    [ "$status" = 0 ] || exit 1
}

modprobe -a 9pnet_virtio
step "kernel module, git, pipx" 'sudo apt-get -q update
sudo DEBIAN_FRONTEND=noninteractive apt-get -qy install git pipx v4l2loopback-dkms "linux-headers-$(uname -r)"'
step "the program" 'git clone -q /host/checkout relit-camera
cd relit-camera
pipx install .
pipx ensurepath'
if [ -d /host/models ]; then
    step "the networks, from a folder" 'relit models pull --from /host/models'
else
    step "the networks" 'relit models pull'
fi
# What a person pastes: the lines below "As root:"; and again, for some things show only then.
for round in first second; do
    step "doctor, the $round time" 'relit doctor --fix >/tmp/doctor.txt || true; cat /tmp/doctor.txt; grep -q "^Relit Camera" /tmp/doctor.txt'
    sed -n '/^As root:/,/^$/s/^    //p' /tmp/doctor.txt >>/host/pasted.txt
    pasted=$(sed -n '/^As root:/,/^$/s/^    //p' /tmp/doctor.txt)
    [ -z "$pasted" ] || step "its lines for root, pasted" "$pasted"
    # "Log in again": the groups of who is logged in, and of the user's systemd, stay as they were.
    loginctl terminate-user you
    while systemctl -q is-active user@1000; do sleep 1; done
done
step "doctor again" 'relit doctor || true'
data=$(runuser -l you -c 'ls -d ~/.local/*/venvs/relit-camera/lib/python3*/site-packages/relit_camera/app/demo/data ~/.local/share/*/venvs/relit-camera/lib/python3*/site-packages/relit_camera/app/demo/data 2>/dev/null | head -n 1')
loginctl enable-linger you
step "as a service" "mkdir -p ~/.config/relit-camera
export XDG_RUNTIME_DIR=/run/user/\$(id -u)
cp $data/adam.relit me.relit
printf 'source:\n  source: $data/clip.mp4\nsubject: /home/you/me.relit\noutput:\n  width: 640\n  height: 360\n' > ~/.config/relit-camera/config.yaml
systemctl --user daemon-reload
systemctl --user enable --now relit-camera
systemctl --user --no-pager status relit-camera
systemctl --user disable --now relit-camera"
step "a browser" 'sudo DEBIAN_FRONTEND=noninteractive apt-get -qy install chromium chromium-driver'
step "the camera starts" "setsid relit run --source $data/clip.mp4 --subject me.relit --environment sunset --size 640x360 >camera.log 2>&1 </dev/null &
camera=\$!
until curl=\$(python3 -c 'import urllib.request as u; print(u.urlopen(\"http://127.0.0.1:8470/api/v1/status\").read().decode())' 2>/dev/null) && echo \"\$curl\" | grep -qE '\"state\":\"(live|standing-in)\"'; do kill -0 \$camera; sleep 2; done
echo \"\$curl\""
step "the call" 'python3 /host/guest/call.py "Relit Camera" /tmp/call 25'
cp /tmp/call-page.png /tmp/call.jsonl /host/
runuser -l you -c 'python3 -c "import urllib.request as u; print(u.urlopen(\"http://127.0.0.1:8470/api/v1/status\").read().decode())"; cat camera.log' >>/host/output.txt 2>&1
pkill -INT -f "relit run"
while pgrep -f "relit run" >/dev/null; do sleep 1; done
printf '%s\t0\tall\t\n' "$(($(date +%s) - began))" >>/host/steps.tsv
