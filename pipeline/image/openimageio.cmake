find_package(OpenImageIO 2.4 REQUIRED)
# Debian's target names the include path of OpenCV, which need not be installed.
get_target_property(patina_oiio_includes OpenImageIO::OpenImageIO INTERFACE_INCLUDE_DIRECTORIES)
list(REMOVE_ITEM patina_oiio_includes /usr/include/opencv4)
set_target_properties(OpenImageIO::OpenImageIO PROPERTIES
  INTERFACE_INCLUDE_DIRECTORIES "${patina_oiio_includes}")
