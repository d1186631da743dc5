# Checks the arrows between the rooms: which folder may include which. Runs as a test:
#   cmake -D ROOT=. -P cmake/layer_check.cmake
# The longest prefix below that fits a file is its room. A room may include itself and what is listed.

cmake_minimum_required(VERSION 3.25)

set(rooms cameras/files cameras/geometry cameras/calibration cameras factors backend/map backend/problem backend/incremental backend
          frontend/features frontend/matching frontend apps)
set(allowed_cameras/files "")
set(allowed_cameras/geometry "")
set(allowed_cameras/calibration cameras/files cameras cameras/geometry)
set(allowed_cameras cameras/geometry)
set(allowed_factors cameras cameras/geometry)
set(allowed_backend/map cameras cameras/geometry cameras/files)
set(allowed_backend/problem backend/map factors cameras cameras/geometry)
set(allowed_backend/incremental backend/problem backend/map factors cameras cameras/geometry)
set(allowed_backend backend/incremental backend/problem backend/map factors cameras cameras/geometry)
set(allowed_frontend/features backend/map)
set(allowed_frontend/matching frontend/features backend/map cameras cameras/geometry)
set(allowed_frontend frontend/features frontend/matching backend/map factors cameras cameras/geometry
    cameras/files cameras/calibration)
set(allowed_apps frontend frontend/features frontend/matching backend backend/incremental backend/problem backend/map
    factors cameras cameras/geometry cameras/files cameras/calibration)

function(room_of path out)
  set(best "")
  foreach(room IN LISTS rooms)
    string(LENGTH "${room}" length)
    string(LENGTH "${best}" best_length)
    string(FIND "${path}" "${room}/" at)
    if(at EQUAL 0 AND length GREATER best_length)
      set(best ${room})
    endif()
  endforeach()
  set(${out} "${best}" PARENT_SCOPE)
endfunction()

set(errors 0)
file(GLOB_RECURSE files RELATIVE ${ROOT}
  ${ROOT}/cameras/*.h ${ROOT}/cameras/*.cpp ${ROOT}/factors/*.h ${ROOT}/factors/*.cpp
  ${ROOT}/backend/*.h ${ROOT}/backend/*.cpp ${ROOT}/frontend/*.h ${ROOT}/frontend/*.cpp
  ${ROOT}/frontend/*.cu ${ROOT}/frontend/*.cuh
  ${ROOT}/apps/*.h ${ROOT}/apps/*.cpp)
foreach(file IN LISTS files)
  room_of(${file} room)
  file(STRINGS ${ROOT}/${file} includes REGEX "^#include ")
  foreach(line IN LISTS includes)
    if(line MATCHES "<(thread|mutex|shared_mutex|condition_variable|future|semaphore)>"
       AND NOT file MATCHES "^apps/slam/")
      message(SEND_ERROR "${file}: threads and mutexes live in apps/slam only: ${line}")
    endif()
    if(line MATCHES "\"([^\"]+)\"")
      set(target ${CMAKE_MATCH_1})
      room_of(${target} target_room)
      if(target_room STREQUAL "")
        message(SEND_ERROR "${file}: not a path from the repository's root: ${line}")
      elseif(NOT target_room STREQUAL room AND NOT target_room IN_LIST allowed_${room})
        message(SEND_ERROR "${file}: ${room} may not include ${target_room}: ${line}")
      endif()
    endif()
  endforeach()
endforeach()
list(LENGTH files count)
message(STATUS "layer check: ${count} files")
