# Flags and helpers every relief target shares.

find_program(RELIEF_CCACHE ccache)
if(RELIEF_CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER "${RELIEF_CCACHE}")
endif()

add_library(relief_options INTERFACE)
target_include_directories(relief_options INTERFACE "${PROJECT_SOURCE_DIR}")
target_compile_features(relief_options INTERFACE cxx_std_20)
target_compile_options(relief_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wnon-virtual-dtor -Wold-style-cast -Wcast-qual
  # Not in a part of another project, whose compiler may warn of more.
  $<$<BOOL:${PROJECT_IS_TOP_LEVEL}>:-Werror>
  # GCC 12 sees overlapping copies in "text" + std::string (its bug 105651); there are none.
  $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>
  # How vectors of eight lanes (displacement/lanes.h) are passed differs between instruction sets; none crosses a file.
  -Wno-psabi
  # sqrt and friends need not set errno, so they can be inlined; results are unchanged.
  -fno-math-errno
  # The renderer never reads floating-point exception flags.
  -fno-trapping-math)
target_compile_definitions(relief_options INTERFACE
  RELIEF_VERSION="${PROJECT_VERSION}"
  $<$<BOOL:${RELIEF_ASSERTS}>:RELIEF_ENABLE_ASSERTS>)
if(RELIEF_SANITIZE)
  target_compile_options(relief_options INTERFACE -fsanitize=${RELIEF_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all)
  target_link_options(relief_options INTERFACE -fsanitize=${RELIEF_SANITIZE})
endif()
if(RELIEF_SANITIZE MATCHES "thread")
  # Parallel loops whose hand-over of work the sanitizer can see; the files there say more.
  target_include_directories(relief_options BEFORE INTERFACE "${PROJECT_SOURCE_DIR}/tests/support/tsan")
endif()

# relief_cold(SOURCES...): files of this folder that read options, JSON of which there is little, and write reports. A release compiles
# them in two thirds of the time for it, and is no slower.
set(relief_cold_options "$<$<CONFIG:Release>:-O1>")
function(relief_cold)
  set_property(SOURCE ${ARGN} APPEND PROPERTY COMPILE_OPTIONS "${relief_cold_options}")
endfunction()

# RELIEF_GROUP_SIZE: most of a folder's files that are compiled as one. Half of what compiles a file is headers that the others include as
# well. A build from nothing is so done sooner, one after a change of a file later.
set(RELIEF_GROUP_SIZE 1 CACHE STRING "Files that are compiled as one, at most")

if(RELIEF_GROUP_SIZE GREATER 1)
  # A tenth of GCC's time is spent on finding memory that it could use again, of which it has enough: a sixth more is used.
  target_compile_options(relief_options INTERFACE $<$<CXX_COMPILER_ID:GNU>:--param=ggc-min-heapsize=1000000>)
endif()

# relief_group_sources(TARGET): what RELIEF_GROUP_SIZE says, once the folder's file has been read. Generated files, and those with
# definitions or options of their own, stay by themselves. The target's property RELIEF_SOURCES is what it had before.
function(relief_group_sources target)
  get_target_property(sources ${target} SOURCES)
  set_target_properties(${target} PROPERTIES RELIEF_SOURCES "${sources}")
  if(RELIEF_GROUP_SIZE LESS 2)
    return()
  endif()
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  set(apart)
  set(warm)
  set(cold)
  foreach(source IN LISTS sources)
    get_source_file_property(definitions "${source}" COMPILE_DEFINITIONS)
    get_source_file_property(options "${source}" COMPILE_OPTIONS)
    cmake_path(ABSOLUTE_PATH source OUTPUT_VARIABLE path)
    cmake_path(IS_PREFIX PROJECT_BINARY_DIR "${path}" is_generated)
    if(definitions OR is_generated OR NOT source MATCHES "^[^$<>]+[.]cpp$")
      list(APPEND apart "${source}")
    elseif(NOT options)
      list(APPEND warm "${path}")
    elseif(options STREQUAL relief_cold_options)
      list(APPEND cold "${path}")
    else()
      list(APPEND apart "${source}")
    endif()
  endforeach()
  foreach(kind warm cold)
    if(NOT ${kind})
      continue()
    endif()
    execute_process(COMMAND "${Python3_EXECUTABLE}" "${PROJECT_SOURCE_DIR}/scripts/group_sources" ${RELIEF_GROUP_SIZE} ${${kind}}
      OUTPUT_VARIABLE groups OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
    # Names may change with what a file says.
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${${kind}})
    string(REPLACE ";" "|" groups "${groups}")
    string(REPLACE "\n" ";" groups "${groups}")
    set(index 0)
    foreach(group IN LISTS groups)
      string(REPLACE "|" "\"\n#include \"" group "#include \"${group}\"\n")
      set(file "${CMAKE_CURRENT_BINARY_DIR}/groups/${target}_${kind}_${index}.cpp")
      file(CONFIGURE OUTPUT "${file}" CONTENT "${group}" @ONLY)
      list(APPEND apart "${file}")
      # A name within a function may be that of a header which only another file includes; and types of a source that is included are
      # taken for those of a header.
      set_property(SOURCE "${file}" APPEND PROPERTY COMPILE_OPTIONS -Wno-shadow $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
      if(kind STREQUAL "cold")
        relief_cold("${file}")
      endif()
      math(EXPR index "${index} + 1")
    endforeach()
  endforeach()
  set_target_properties(${target} PROPERTIES SOURCES "${apart}")
endfunction()

# relief_add_library(NAME sources...): a static library with the project's flags.
function(relief_add_library name)
  add_library(${name} STATIC ${ARGN})
  target_link_libraries(${name} PUBLIC relief_options)
  cmake_language(EVAL CODE "cmake_language(DEFER CALL relief_group_sources ${name})")
endfunction()

# relief_end_tbb(TARGET): if the address sanitizer looks for leaks when TARGET's program ends, no worker of TBB is left by then.
function(relief_end_tbb target)
  if(RELIEF_SANITIZE MATCHES "address")
    target_sources(${target} PRIVATE "${PROJECT_SOURCE_DIR}/tests/support/tbb_at_exit.cpp")
    target_link_libraries(${target} PRIVATE TBB::tbb)
  endif()
endfunction()

# relief_add_tests(NAME [WHOLE] LABELS l... LIBRARIES t... SOURCES s...): one GoogleTest executable, each TEST a CTest test.
# WHOLE: all of them are one, for programs that take longer to load their libraries than for most of their tests.
# Compiled with relief_test_options besides the project's own.
function(relief_add_tests name)
  cmake_parse_arguments(arg "WHOLE" "" "LABELS;LIBRARIES;SOURCES" ${ARGN})
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE ${arg_LIBRARIES} GTest::gtest_main)
  relief_end_tbb(${name})
  target_compile_options(${name} PRIVATE ${relief_test_options})
  cmake_language(EVAL CODE "cmake_language(DEFER CALL relief_group_sources ${name})")
  if(arg_WHOLE)
    add_test(NAME ${name} COMMAND ${name})
    set_tests_properties(${name} PROPERTIES LABELS "${arg_LABELS}" TIMEOUT 600)
    return()
  endif()
  include(GoogleTest)
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60 PROPERTIES TIMEOUT 600)
  # Its PROPERTIES take no lists: of several labels only the first would remain. CTest includes this file after the one
  # that lists the tests.
  set(labels_file "${CMAKE_CURRENT_BINARY_DIR}/${name}_labels.cmake")
  file(WRITE "${labels_file}" "if(${name}_TESTS)
  set_tests_properties(\${${name}_TESTS} PROPERTIES LABELS \"${arg_LABELS}\")
endif()
")
  set_property(DIRECTORY APPEND PROPERTY TEST_INCLUDE_FILES "${labels_file}")
endfunction()
