add_library(patina_reference STATIC
  ${CMAKE_CURRENT_LIST_DIR}/color_choice.cpp
  ${CMAKE_CURRENT_LIST_DIR}/color_encoding.cpp
  ${CMAKE_CURRENT_LIST_DIR}/map_plan.cpp
  ${CMAKE_CURRENT_LIST_DIR}/mip_filter.cpp
  ${CMAKE_CURRENT_LIST_DIR}/normal_convention.cpp
  ${CMAKE_CURRENT_LIST_DIR}/reference.cpp
  ${CMAKE_CURRENT_LIST_DIR}/source_maps.cpp
)
target_link_libraries(patina_reference PUBLIC patina_target patina_image patina_color patina_effects patina_base)
