#pragma once
// GLB files as another reader than ours sees them.

#include <string>

#include <gtest/gtest.h>
#include <tiny_gltf.h>

namespace roomtex {

inline tinygltf::Model LoadGlb(const std::string& path) {
  tinygltf::Model model;
  tinygltf::TinyGLTF loader;
  std::string error, warning;
  EXPECT_TRUE(loader.LoadBinaryFromFile(&model, &error, &warning, path)) << error;
  EXPECT_EQ(error + warning, "");
  return model;
}

}  // namespace roomtex
