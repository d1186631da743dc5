if(HYBRID_SLAM_SANITIZE)
  add_compile_options(-fsanitize=${HYBRID_SLAM_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${HYBRID_SLAM_SANITIZE})
  # Under the address sanitizer Eigen would align by hand what libraries built without it (OpenGV) allocate by
  # malloc and we free. The sanitizer's malloc is aligned, too.
  add_compile_definitions(EIGEN_MALLOC_ALREADY_ALIGNED=1)
  # False alarms of gcc 12 that only the sanitizers' instrumentation brings up.
  add_compile_options(-Wno-error=array-bounds -Wno-error=maybe-uninitialized)
endif()
