#!/usr/bin/env bash
# add_subdirectory.sh SOURCE BUILD: the library as a part of another project: one component is built and used, all
# are configured.
set -euo pipefail
source=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

cat >"$folder/CMakeLists.txt" <<TEXT
cmake_minimum_required(VERSION 3.25)
project(consumer LANGUAGES CXX)
include(FetchContent)
FetchContent_Declare(hybrid_slam SOURCE_DIR $source)
FetchContent_MakeAvailable(hybrid_slam)
add_executable(consumer $source/examples/camera_and_factor.cpp)
target_link_libraries(consumer PRIVATE hybrid_slam::factors)
TEXT
cmake -S "$folder" -B "$folder/part" -G Ninja -D HYBRID_SLAM_COMPONENTS=factors -D CMAKE_CXX_FLAGS=-O1 \
  -D CMAKE_DISABLE_FIND_PACKAGE_OpenCV=ON >/dev/null
cmake --build "$folder/part" --target consumer
"$folder/part/consumer"
[[ ! -e $folder/part/bin && ! -e $folder/part/CMakeFiles/hs_python.dir ]]
# Linking all of it needs every target that it names: configuring says whether they are seen from outside.
sed -i 's/hybrid_slam::factors/hybrid_slam::slam/' "$folder/CMakeLists.txt"
cmake -S "$folder" -B "$folder/all" -G Ninja >/dev/null
