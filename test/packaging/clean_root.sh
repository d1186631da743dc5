#!/usr/bin/env bash
# clean_root.sh SOURCE BUILD: makes the Debian packages, installs them in a root with nothing but Debian 12's
# minimal system, works there, and looks whether removing them leaves anything.
set -euo pipefail
source=$1 build=$2
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
skip() { echo "SKIPPED: $*"; exit 0; }
[[ $(id -u) -eq 0 ]] || skip "a root of one's own takes root"
command -v debootstrap >/dev/null || skip "no debootstrap"
[[ -x $build/bin/scene_renderer ]] || skip "no scene_renderer"

folder=$(mktemp -d)
root=$folder/root
trap 'umount "$root/proc" 2>/dev/null || true; rm -rf "$folder"' EXIT
say() { echo "clean root: $*"; }
inside() { chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
  DEBIAN_FRONTEND=noninteractive "$@"; }

cmake --build "$build" --target packaged
cpack --config "$build/CPackConfig.cmake" -B "$folder/packages" >/dev/null
if [[ -n ${HYBRID_SLAM_CLEAN_ROOT:-} ]]; then
  cp -a "$HYBRID_SLAM_CLEAN_ROOT" "$root"
else
  debootstrap --variant=minbase bookworm "$root" "$mirror" >"$folder/log" 2>&1 ||
    { tail -n 1 "$folder/log"; skip "no root could be made from $mirror"; }
fi
mount -t proc proc "$root/proc"
cp "$folder"/packages/{hybrid-slam_,hybrid-slam-live_,python3-hybrid-slam_}*.deb "$root/tmp/"
ls "$root"/tmp/*.deb

inside apt-get -qq update
# The packages that they depend on first, so that what they themselves leave can be told.
inside sh -c 'apt-get -qq install -y --no-install-recommends \
  $(for deb in /tmp/*.deb; do dpkg-deb -f $deb Depends; done | tr , "\n" | grep -v hybrid-slam |
    sed "s/([^)]*)//; s/|.*//" | sort -u)' >"$folder/log" 2>&1 || { tail -n 5 "$folder/log"; exit 1; }
find_files() { (cd "$root" && find . -xdev \( -path ./proc -o -path ./tmp -o -path ./var/lib/dpkg -o -path ./var/log \
  -o -path ./var/cache -o -path ./var/lib/apt -o -path ./root \) -prune -o -print | sort); }
find_files >"$folder/before"
inside sh -c 'apt-get -qq install -y --no-install-recommends /tmp/*.deb' >"$folder/log" 2>&1 ||
  { tail -n 5 "$folder/log"; exit 1; }

say "the programs"
inside hybrid_slam --version
inside scene_renderer /root/data --sequence demo --frames 8 --resolution 320x240 >/dev/null
inside hybrid_slam /root/data --out /root/out --quiet
[[ $(wc -l <"$root/root/out/stereo.tum") -ge 6 ]]
say "cameras"
said=$(inside hybrid_slam live --left rtsp://127.0.0.1:9/none --split --timeout 10 --out /root/live \
  --calibration /root/data/hybrid/calibration/{left,right}_camera.yaml 2>&1) && status=0 || status=$?
[[ $status -eq 3 && $said == *"cannot be opened"* ]] || { echo "live: exit code $status: $said"; exit 1; }
say "the man pages, the completion, the vocabulary"
has_option() { gzip -dc "$root/usr/share/man/man1/$1.1.gz" | grep -q -- "--$2\|\\\\-\\\\-$2"; }
has_option hybrid_slam sequence
has_option hybrid_slam-live record
inside bash -c 'source /usr/share/bash-completion/completions/hybrid_slam
  COMP_WORDS=(hybrid_slam --lay) COMP_CWORD=1; _hybrid_slam hybrid_slam; [[ ${COMPREPLY[*]} == --layout ]]
  COMP_WORDS=(hybrid_slam --mode ev) COMP_CWORD=2; _hybrid_slam hybrid_slam; [[ ${COMPREPLY[*]} == every-frame ]]'
cmp "$root/usr/share/hybrid_slam/default_vocabulary.voc" "$source/frontend/place_recognition/default_vocabulary.voc"
if [[ -e $(echo "$root"/tmp/python3-*.deb) ]]; then
  say "Python"
  inside python3 -c 'import hybrid_slam as hs
sequence = hs.open_sequence("/root/data")
session = hs.Session(sequence.rig, mode="every-frame")
for frame in sequence:
    session.push_stereo(frame.time, frame.left, frame.right)
    if frame.fisheye is not None:
        session.push_fisheye(frame.time, frame.fisheye)
session.finish()
session.trajectory().write_tum("/root/python.tum")'
  cmp "$root/root/python.tum" "$root/root/out/stereo.tum"
fi

inside sh -c 'apt-get -qq purge -y hybrid-slam hybrid-slam-live $(dpkg-query -W -f "\${Package} " python3-hybrid-slam 2>/dev/null)' \
  >"$folder/log" 2>&1 || { tail -n 5 "$folder/log"; exit 1; }
find_files >"$folder/after"
diff "$folder/before" "$folder/after" || { echo "removing the packages left files"; exit 1; }
say "nothing is left after removal"
