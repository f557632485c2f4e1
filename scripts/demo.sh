#!/bin/sh
# Relights a recorded video under three environments into folder $1.
#
# Where a folder of captures, clips and models lies beside the checkout (or where RELIT_SHARED says), it shows a captured
# person who follows a recorded one; elsewhere a generated mannequin who follows its own clip. Nothing is downloaded.
set -eu

out=${1:-build/demo}
bin=${BIN:-.venv/bin}
shared=${RELIT_SHARED:-../shared}
work=$(dirname "$out")
mkdir -p "$out"

if [ -f "$shared/olat/adam/lights.lp" ] && [ -f "$shared/driving/adam_talk.mp4" ] && [ -d "$shared/models" ]; then
    export RELIT_MODELS_DIR="$work/models"
    "$bin/relit" models pull --from "$shared/models" face_detector_yunet face_mesh
    lights=$shared/olat/adam/lights.lp clip=$shared/driving/adam_talk.mp4 tracker=mesh
else
    echo "Generating a mannequin: its pictures under one light each, and a clip of it talking"
    "$bin/python" -m relit_studio.mannequin --out "$work/mannequin"
    lights=$work/mannequin/olat/lights.lp clip=$work/mannequin/clip.mp4 tracker=recorded:$work/mannequin/track.json
fi

"$bin/relit" capture import "$lights" --out "$out/subject.relit"
for environment in studio sunset party; do
    "$bin/relit" replay "$clip" --subject "$out/subject.relit" --environment "$environment" --background environment \
        --tracker "$tracker" --out "$out/$environment.mp4" --contact-sheet "$out/$environment.png"
done

cat <<END

Made in $out: subject.relit, the relightable person; and from $clip
  studio.mp4  sunset.mp4  party.mp4   that person in three places, moving as the clip does
  studio.png  sunset.png  party.png   a dozen frames of each, the clip's above the relit ones

See one still under a light of your own, from the picture's right and 30 degrees up:
  $bin/relit relight $out/subject.relit --light 90,30 --out $out/still.png
END
