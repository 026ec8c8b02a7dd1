# cmake -DSOURCE=… -DOUTPUT=… -P commit.cmake: writes a source with the commit that the tree is at (cli/version.h), if that has changed.
cmake_minimum_required(VERSION 3.25)
execute_process(COMMAND git -C "${SOURCE}" describe --always --dirty --abbrev=12 --exclude=*
  OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed ERROR_QUIET)
if(failed)
  set(commit "unknown")  # a tree without git
endif()
file(CONFIGURE OUTPUT "${OUTPUT}" CONTENT "#include \"cli/version.h\"\n\nconst char* const relief::kCommit = \"@commit@\";\n" @ONLY)
