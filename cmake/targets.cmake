# The one way to declare a target of ours. Includes are written from the repository's root.

add_library(hs_options INTERFACE)
if(PROJECT_IS_TOP_LEVEL AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")  # clang, for test/fuzz alone, warns of other things
  target_compile_options(hs_options INTERFACE -Wall -Wextra -Wconversion -Wshadow=local)
  if(NOT SKBUILD)  # pip's users have compilers and a pybind11 of their own
    target_compile_options(hs_options INTERFACE -Werror)
  endif()
endif()
target_include_directories(hs_options INTERFACE ${PROJECT_SOURCE_DIR})
# Every object may go into a shared library (the Python module). All of them alike: they share precompiled
# headers. Nothing of ours is replaced at load time, so calls may still be inlined.
target_compile_options(hs_options INTERFACE $<$<COMPILE_LANGUAGE:CXX>:-fPIC -fno-semantic-interposition>)

# Where headers of ours find one another: under the repository's root, or where it is installed.
set(HS_INCLUDES $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include/hybrid_slam>)

# The system's BLAS before all others: Debian's libceres asks for ATLAS by name, and CHOLMOD, which
# calls whatever is found first, would take that too.
set(HS_BLAS_FIRST LINKER:--push-state,--no-as-needed,${BLAS_LIBRARY},--pop-state)

# Headers that nearly every source reads, parsed once per build: a good part of a clean build's time.
# Sources include what they use all the same; the preset dev, which does without, sees to it.
option(HYBRID_SLAM_PRECOMPILED_HEADERS "Parse the headers of other libraries once" ${PROJECT_IS_TOP_LEVEL})
if(HYBRID_SLAM_PRECOMPILED_HEADERS AND CCACHE_PROGRAM)
  target_compile_options(hs_options INTERFACE -fpch-preprocess)  # without it ccache must give up
endif()

# hs_precompiled(name HEADERS <a> ... DEPENDS targets ...): a set of headers, in this order.
function(hs_precompiled name)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEPENDS" ${ARGN})
  if(HYBRID_SLAM_PRECOMPILED_HEADERS)
    if(NOT EXISTS ${PROJECT_BINARY_DIR}/empty.cpp)
      file(WRITE ${PROJECT_BINARY_DIR}/empty.cpp "")
    endif()
    add_library(${name} STATIC ${PROJECT_BINARY_DIR}/empty.cpp)
    target_link_libraries(${name} PRIVATE hs_options ${ARG_DEPENDS})
    target_precompile_headers(${name} PRIVATE ${ARG_HEADERS})
  endif()
endfunction()

function(hs_use_precompiled name headers)
  if(HYBRID_SLAM_PRECOMPILED_HEADERS)
    target_precompile_headers(${name} REUSE_FROM ${headers})
  endif()
endfunction()

hs_precompiled(hs_common_headers
  HEADERS <algorithm> <array> <cmath> <cstdint> <filesystem> <functional> <map> <memory> <optional> <span>
          <stdexcept> <string> <string_view> <utility> <variant> <vector> <Eigen/Dense>
  DEPENDS Eigen3::Eigen)

# hs_alone(a.cpp ...): sources that are compiled by themselves where others are compiled several at once
# (CMAKE_UNITY_BUILD): names or macros of theirs, or what they define for a whole program, get in the way.
function(hs_alone)
  set_source_files_properties(${ARGV} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# hs_library(name SOURCES a.cpp ... DEPENDS public targets ... PRIVATE_DEPENDS hidden targets ...)
# A room without a .cpp file is a header-only library.
function(hs_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS;PRIVATE_DEPENDS" ${ARGN})
  if(ARG_SOURCES)
    add_library(${name} STATIC ${ARG_SOURCES})
    target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:hs_options> PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE_DEPENDS})
    target_include_directories(${name} PUBLIC ${HS_INCLUDES})
    hs_use_precompiled(${name} hs_common_headers)
  else()
    add_library(${name} INTERFACE)
    target_link_libraries(${name} INTERFACE ${ARG_DEPENDS})
    target_include_directories(${name} INTERFACE ${HS_INCLUDES})
  endif()
endfunction()

# hs_program(name SOURCES main.cpp ... DEPENDS ...): a program in bin/.
function(hs_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_options(${name} PRIVATE ${HS_BLAS_FIRST})
  target_link_libraries(${name} PRIVATE hs_options ${ARG_DEPENDS})
  hs_use_precompiled(${name} hs_common_headers)
endfunction()

# hs_test(name SOURCES a_test.cpp ... DEPENDS ...): a Catch2 program whose cases become CTest tests.
# Cases tagged [slow], in a program declared SLOW, get the label "slow" (with BY_HAND: "by_hand", see
# CONTRIBUTING.md), all others "ci". A case that
# needs the shared data and does not find it prints "SKIPPED" and is reported as skipped.
function(hs_test name)
  cmake_parse_arguments(ARG "SLOW;BY_HAND" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_options(${name} PRIVATE ${HS_BLAS_FIRST})
  target_link_libraries(${name} PRIVATE hs_options ${ARG_DEPENDS} hs_catch_main Ceres::ceres)
  hs_use_precompiled(${name} hs_test_headers)
  set(skip SKIP_REGULAR_EXPRESSION "SKIPPED: ")
  catch_discover_tests(${name} TEST_SPEC "~[slow]" PROPERTIES LABELS ci ${skip} TIMEOUT 300)
  if(ARG_SLOW)
    set(label slow)
    if(ARG_BY_HAND)
      set(label by_hand)
    endif()
    catch_discover_tests(${name} TEST_SPEC "[slow]" TEST_SUFFIX " (slow)" PROPERTIES LABELS ${label} ${skip} TIMEOUT 3600)
  endif()
endfunction()

# hs_benchmark(name_benchmark SOURCES ... DEPENDS ...): a google-benchmark program in bin/, built by
# the target "benchmarks".
function(hs_benchmark name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_options(${name} PRIVATE ${HS_BLAS_FIRST})
  target_link_libraries(${name} PRIVATE hs_options ${ARG_DEPENDS} benchmark::benchmark_main)
  if(NOT TARGET benchmarks)
    add_custom_target(benchmarks)
  endif()
  add_dependencies(benchmarks ${name})
endfunction()
