# What `cpack -G DEB` makes a package of; scripts/package calls it, and says which packages of Debian it depends on.
set(CPACK_PACKAGE_NAME relief)
set(CPACK_PACKAGE_VENDOR "The relief authors")
set(CPACK_PACKAGE_CONTACT "The relief authors <maintainers@relief.invalid>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "path tracer for scenes whose detail lives in displacement maps")
set(CPACK_PACKAGE_DESCRIPTION "glTF scenes go in; OpenEXR pictures with their estimated error come out. It runs on processors, from a shell or from Blender.")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_COMPONENTS_ALL program)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME relief)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS OFF)
# scripts/package finds out: the program depends on its libraries; that of the module which reads images other than PNG, JPEG, HDR and EXR, and which
# brings along 245 others, is recommended.
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS OFF)
include(CPack)
