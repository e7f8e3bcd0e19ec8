// The parsers of others, built here once more so that the sanitizers and the search for new paths see
// inside them; a program prefers these to those of the shared libraries.
#define STB_IMAGE_IMPLEMENTATION
#include <stb_image.h>
#define TINYOBJLOADER_IMPLEMENTATION
#include <tiny_obj_loader.h>
