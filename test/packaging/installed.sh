#!/usr/bin/env bash
# installed.sh SOURCE BUILD: installs the library under a prefix, builds the examples from there, and runs them.
set -euo pipefail
source=$1 build=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cmake --install "$build" --prefix "$folder/prefix" --component dev >/dev/null
mv "$folder/prefix" "$folder/elsewhere"  # it may be moved
cp -r "$source/examples" "$folder/examples"

# One component asks for its own packages only: without Ceres, OpenCV and the others it is found all the same.
mkdir "$folder/cameras"
cat >"$folder/cameras/CMakeLists.txt" <<'TEXT'
cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES CXX)
find_package(hybrid_slam REQUIRED COMPONENTS cameras)
add_library(consumer OBJECT consumer.cpp)
target_link_libraries(consumer PRIVATE hybrid_slam::cameras)
TEXT
cat >"$folder/cameras/consumer.cpp" <<'TEXT'
#include <hybrid_slam/apps/slam/version.h>
#include <hybrid_slam/cameras/camera.h>
static_assert(HYBRID_SLAM_VERSION_MAJOR >= 0);
double focal_length_of(const hybrid_slam::Camera& camera) { return focal_length(camera); }
TEXT
configure() { cmake -S "$1" -B "$1/build" -G Ninja -D CMAKE_PREFIX_PATH="$folder/elsewhere" "${@:2}" >"$folder/log" 2>&1; }
configure "$folder/cameras" -D CMAKE_DISABLE_FIND_PACKAGE_Ceres=ON -D CMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON \
  -D CMAKE_DISABLE_FIND_PACKAGE_PkgConfig=ON -D CMAKE_CXX_FLAGS=-Werror || { cat "$folder/log"; exit 1; }
cmake --build "$folder/cameras/build"
sed -i 's/COMPONENTS cameras/COMPONENTS lidar/' "$folder/cameras/CMakeLists.txt"
! configure "$folder/cameras" || { echo "a component that is not there was found"; exit 1; }
grep -q "no component lidar" "$folder/log"

configure "$folder/examples" -D CMAKE_BUILD_TYPE=Release || { cat "$folder/log"; exit 1; }
cmake --build "$folder/examples/build"
for program in camera_and_factor own_factor sift_and_matching; do "$folder/examples/build/$program"; done
if [[ -x $build/bin/scene_renderer ]]; then
  "$build/bin/scene_renderer" "$folder/data" --sequence demo --frames 6 --resolution 320x240
  "$folder/examples/build/session_from_files" "$folder/data" "$folder/map.hslam" | tail -n 1
  [[ -s $folder/map.hslam ]]
fi
