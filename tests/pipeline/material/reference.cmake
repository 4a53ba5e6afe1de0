patina_add_test(NAME mip_filter_test SOURCES ${CMAKE_CURRENT_LIST_DIR}/mip_filter_test.cpp LIBS patina_reference)
patina_add_test(NAME reference_test SOURCES ${CMAKE_CURRENT_LIST_DIR}/reference_effects_test.cpp
          ${CMAKE_CURRENT_LIST_DIR}/reference_test.cpp
  LIBS patina_reference patina_test_images)
patina_add_test(NAME reference_color_test SOURCES ${CMAKE_CURRENT_LIST_DIR}/reference_color_test.cpp
  LIBS patina_reference patina_test_images)
