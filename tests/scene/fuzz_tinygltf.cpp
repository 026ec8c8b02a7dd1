// tinygltf itself, compiled for the fuzz target only: the system's library carries no instrumentation.
#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>
