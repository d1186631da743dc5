if(HYBRID_SLAM_SANITIZE)
  add_compile_options(-fsanitize=${HYBRID_SLAM_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  add_link_options(-fsanitize=${HYBRID_SLAM_SANITIZE})
endif()
