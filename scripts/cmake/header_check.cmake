# relief_add_header_check(FOLDERS f... LIBRARIES t...): the target relief_header_check compiles every header of the
# folders by itself, so that none depends on what was included before it. It is not part of the default build:
# scripts/test asks for it.
function(relief_add_header_check)
  cmake_parse_arguments(arg "" "" "FOLDERS;LIBRARIES" ${ARGN})
  set(sources)
  foreach(folder IN LISTS arg_FOLDERS)
    file(GLOB_RECURSE headers CONFIGURE_DEPENDS RELATIVE "${PROJECT_SOURCE_DIR}" "${PROJECT_SOURCE_DIR}/${folder}/*.h")
    foreach(header IN LISTS headers)
      set(source "${PROJECT_BINARY_DIR}/header_check/${header}.cpp")
      # Twice, so that a missing #pragma once is found too.
      file(CONFIGURE OUTPUT "${source}" CONTENT "#include \"${header}\"\n#include \"${header}\"\n" @ONLY)
      list(APPEND sources "${source}")
    endforeach()
  endforeach()
  add_library(relief_header_check OBJECT EXCLUDE_FROM_ALL ${sources})
  target_link_libraries(relief_header_check PRIVATE ${arg_LIBRARIES})
  # Only whether it compiles matters, so no time is spent on optimizing.
  target_compile_options(relief_header_check PRIVATE -O0)
endfunction()
