// The parser of others, built here once more so that the sanitizers and the search for new paths see inside
// it; a program prefers it to that of the shared library.
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>
