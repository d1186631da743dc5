#!/usr/bin/env bash
# Packs all that run_all.py needs on a machine with a GPU into one archive OUT (default:
# build/gpu-pack.tar.xz): the programs with CUDA for sm_90 and PTX and the libraries they need beyond
# glibc, cuts of H1 and KITTI s1 from HYBRID_SLAM_DATA, the CPU engine's results on them, and the
# sources of frontend/features/cuda. There:
#   python3 -m tarfile -e gpu-pack.tar.xz . && python3 gpu-pack/run_all.py --out DIR
set -euo pipefail
cd "$(dirname "$(readlink -f "$0")")/../../.."
readonly HERE=test/benchmark/gpu BUILD=${BUILD:-build/gpu-pack}  # another build folder may be named
readonly H1_MOMENTS=32 KITTI_FRAMES=15
readonly MOST_BYTES=$((45 * 1024 * 1024))
out=${1:-build/gpu-pack.tar.xz}
jobs=${JOBS:-$(nproc)}

die() {
  echo "pack.sh: $1" >&2
  exit 1
}

[[ $# -le 1 && ${1:-} != -* ]] || die "usage: pack.sh [OUT]"
data=${HYBRID_SLAM_DATA:-}
[[ -n $data ]] || die "where are the data? HYBRID_SLAM_DATA must name the folder with uwsynth/ and kitti/"
h1=$data/uwsynth/hybrid/H1 kitti=$data/kitti
for part in "$h1/images/raw" "$h1/../calibration" "$kitti/sequences/s1" "$kitti/poses/s1.txt"; do
  [[ -e $part ]] || die "the data are missing: $part"
done
mkdir -p "$(dirname "$out")"
[[ $(git check-ignore -q "$out" && echo yes) == yes || $(readlink -f "$out") != "$PWD"/* ]] ||
  die "$out lies in the repository, and git does not ignore it"

echo "pack.sh: building in $BUILD (minutes, the first time)"
PATH=$PATH:/usr/local/cuda/bin
unity=()
[[ -f $BUILD/CMakeCache.txt ]] || unity=(-D CMAKE_UNITY_BUILD=ON)
log=$(mktemp)
trap 'rm -f "$log"' EXIT
{
  # A path that the programs carry in themselves, before all others, also for libraries of libraries.
  readonly rpath=(-D "CMAKE_BUILD_RPATH=\$ORIGIN/../lib"
    -D "CMAKE_EXE_LINKER_FLAGS=-Wl,--disable-new-dtags")
  cmake -G Ninja -S . -B $BUILD -D CMAKE_BUILD_TYPE=Release -D HYBRID_SLAM_TESTS=OFF \
    -D HYBRID_SLAM_CUDA=ON -D CMAKE_CUDA_ARCHITECTURES=90 "${rpath[@]}" "${unity[@]}" &&
    cmake --build $BUILD -j "$jobs" --target hybrid_slam feature_eval trajectory_eval &&
    cmake -G Ninja -S frontend/features/cuda -B $BUILD/cuda -D CMAKE_BUILD_TYPE=Release \
      -D CMAKE_CUDA_ARCHITECTURES=90 "${rpath[@]}" &&
    cmake --build $BUILD/cuda -j "$jobs" --target sift_cuda_bench sift_cuda_test
} >"$log" 2>&1 || {
  tail -n 40 "$log" >&2
  die "building failed"
}

pack=$BUILD/gpu-pack
rm -rf "$pack"
mkdir -p "$pack"/{bin,lib,source}
cp $HERE/{run_all,steps,report}.py "$pack"
for program in $BUILD/bin/{hybrid_slam,feature_eval,trajectory_eval} $BUILD/cuda/sift_cuda_{bench,test}; do
  strip -o "$pack/bin/${program##*/}" "$program"
done

# What glibc itself brings, which must be the machine's own.
readonly GLIBC='^(linux-vdso|ld-linux-x86-64|libc|libm|libdl|librt|libpthread|libresolv|libutil)\.so'
ldd "$pack"/bin/* | awk '$2 == "=>" {print $1, $3}' | sort -u | grep -Ev "$GLIBC" |
  while read -r name path; do
    [[ -f $path ]] || die "library $name is not found"
    cp -L "$path" "$pack/lib/$name"
  done
strip --strip-unneeded "$pack"/lib/*
# The programs carry their path for libraries' libraries, too.
strangers=$(env -u LD_LIBRARY_PATH ldd "$pack"/bin/* | awk '$2 == "=>" {print $1, $3}' | sort -u |
  grep -Ev "$GLIBC" | grep -v "/bin/\.\./lib/" || true)
[[ -z $strangers ]] || die "not in the pack: $strangers"

echo "pack.sh: cutting $H1_MOMENTS moments of H1 and $KITTI_FRAMES frames of KITTI s1"
target=$pack/data/uwsynth/hybrid/H1
mkdir -p "$target/images/raw" "$pack"/data/kitti/{poses,sequences/s1/image_0,sequences/s1/image_1}
cp -r "$h1/../calibration" "$target/../calibration"
for ((i = 0; i < H1_MOMENTS; ++i)); do
  cp "$h1/images/raw/${i}_"{left,right,fish}.jpg "$target/images/raw"
done
for file in camera_poses.txt times.txt gt_left_tum.txt gt_fish_tum.txt; do
  # The first lines that are no comments.
  awk -v n=$H1_MOMENTS '/^#/ {print; next} n-- > 0' "$h1/$file" >"$target/$file"
done
cp "$kitti/sequences/s1/calib.txt" "$pack/data/kitti/sequences/s1"
for file in sequences/s1/times.txt poses/s1.txt; do
  head -n $KITTI_FRAMES "$kitti/$file" >"$pack/data/kitti/$file"
done
for ((i = 0; i < KITTI_FRAMES; ++i)); do
  for camera in 0 1; do
    cp "$kitti/sequences/s1/image_$camera/$(printf %06d.png "$i")" "$pack/data/kitti/sequences/s1/image_$camera"
  done
done
chmod -R u+w "$pack"

# The sources, and what their own build needs around them.
git ls-files -z frontend/features frontend/matching/*.h backend/map/*.h cameras cmake |
  tar -c --null -T - | tar -x -C "$pack/source"

printf '{"commit": "%s", "date": "%s", "h1_moments": %d, "kitti_frames": %d, "cuda_architectures": "90"}\n' \
  "$(git describe --always --dirty --abbrev=12)" "$(date -u +%FT%TZ)" $H1_MOMENTS $KITTI_FRAMES >"$pack/pack.json"

echo "pack.sh: the CPU's results, for comparison"
work=$(mktemp -d)
trap 'rm -rf "$log" "$work"' EXIT
env -u LD_LIBRARY_PATH python3 "$pack/run_all.py" --make-reference --out "$work" || {
  tail -n 20 "$work/gpu.log" >&2
  die "the packed programs failed"
}
find "$pack" -name __pycache__ -exec rm -r {} +

tar -C $BUILD --owner=0 --group=0 --sort=name -c gpu-pack | xz -9 -T "$jobs" >"$out.part"
mv "$out.part" "$out"
size=$(stat -c %s "$out")
echo "pack.sh: $out, $size bytes, $(find "$pack/lib" -type f | wc -l) libraries"
((size <= MOST_BYTES)) || die "larger than $MOST_BYTES bytes"
