#pragma once
// E57 files made byte by byte: what no writer would write, too.

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "importers/e57_pages.h"

namespace roomtex {

// The number, little-endian.
template <typename Number>
std::string Bytes(Number number) {
  std::string bytes;
  for (size_t i = 0; i < sizeof(Number); ++i) {
    bytes += static_cast<char>(static_cast<uint64_t>(number) >> (8 * i));
  }
  return bytes;
}

inline std::string Bytes(float number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

inline std::string Bytes(double number) {
  return {reinterpret_cast<const char*>(&number), sizeof(number)};
}

template <typename Number>
std::string StreamOf(const std::vector<Number>& numbers) {
  std::string bytes;
  for (const Number number : numbers) bytes += Bytes(number);
  return bytes;
}

// Values of num_bits bits each, least significant bit first.
inline std::string BitStream(const std::vector<uint64_t>& values, int num_bits) {
  std::string bytes((values.size() * static_cast<size_t>(num_bits) + 7) / 8, '\0');
  size_t at = 0;
  for (const uint64_t value : values) {
    for (int bit = 0; bit < num_bits; ++bit, ++at) {
      bytes[at / 8] = static_cast<char>(bytes[at / 8] | (value >> bit & 1) << at % 8);
    }
  }
  return bytes;
}

class E57Bytes {
 public:
  static constexpr size_t kPage = 1024;

  // hole: so many bytes, whole pages, lie before all of this; whoever writes the file puts them in.
  explicit E57Bytes(uint64_t hole = 0) : hole_(hole) {}

  // Sections are given by their physical offset, for the XML.
  uint64_t AddBlob(const std::string& bytes) {
    const uint64_t offset = Start();
    logical_ += std::string(8, '\0') + Bytes(uint64_t{16} + bytes.size()) + bytes;
    return offset;
  }

  // One stream per field, cut into pieces of `piece` bytes; a stream k times as long as another
  // one is ahead of it or behind it then.
  uint64_t AddPoints(const std::vector<std::string>& streams, size_t piece = 5000,
                     const std::string& before_data = "") {
    const uint64_t offset = Start();
    std::string packets = before_data;
    size_t longest = 1;
    for (const std::string& stream : streams) longest = std::max(longest, stream.size());
    for (size_t at = 0; at < longest; at += piece) {
      std::vector<std::string> pieces;
      for (const std::string& stream : streams) {
        pieces.push_back(stream.substr(std::min(at, stream.size()), piece));
      }
      packets += Packet(pieces);
    }
    const size_t data = logical_.size() + 32;
    logical_ += std::string("\1\0\0\0\0\0\0\0", 8) + Bytes(uint64_t{32} + packets.size()) +
                Bytes(Physical(data) + hole_) + Bytes(uint64_t{0}) + packets;
    return offset;
  }

  static std::string Packet(const std::vector<std::string>& streams) {
    std::string lengths, body;
    for (const std::string& stream : streams) {
      lengths += Bytes(static_cast<uint16_t>(stream.size()));
      body += stream;
    }
    const size_t size = 6 + lengths.size() + body.size(), padded = (size + 3) / 4 * 4;
    return std::string("\1\0", 2) + Bytes(static_cast<uint16_t>(padded - 1)) +
           Bytes(static_cast<uint16_t>(streams.size())) + lengths + body +
           std::string(padded - size, '\0');
  }

  // The whole file.
  std::string Finish(const std::string& xml) {
    const uint64_t offset = Start();
    logical_ += xml;
    const size_t payload = kPage - 4, num_pages = (logical_.size() + payload - 1) / payload;
    logical_.resize(num_pages * payload, ' ');
    logical_.replace(0, 48,
                     "ASTM-E57" + Bytes(uint32_t{1}) + Bytes(uint32_t{0}) +
                         Bytes(uint64_t{num_pages * kPage + hole_}) + Bytes(offset) +
                         Bytes(uint64_t{xml.size()}) + Bytes(uint64_t{kPage}));
    std::string file;
    for (size_t i = 0; i < num_pages; ++i) file += PageOf(logical_.substr(i * payload, payload));
    return file;
  }

  // With its checksum.
  static std::string PageOf(const std::string& payload) {
    const uint32_t crc = Crc32c(payload);
    std::string page = payload;
    for (const int shift : {24, 16, 8, 0}) page += static_cast<char>(crc >> shift);
    return page;
  }

  // All checksums anew, after bytes were changed.
  static std::string Mended(const std::string& file) {
    std::string mended;
    for (size_t at = 0; at + kPage <= file.size(); at += kPage) {
      mended += PageOf(file.substr(at, kPage - 4));
    }
    return mended;
  }

 private:
  static uint64_t Physical(size_t logical) {
    return logical / (kPage - 4) * kPage + logical % (kPage - 4);
  }
  uint64_t Start() {
    logical_.resize((logical_.size() + 3) / 4 * 4, '\0');
    return Physical(logical_.size()) + hole_;
  }

  uint64_t hole_;
  std::string logical_ = std::string(48, '\0');
};

// <name type="type" attributes>text</name>
inline std::string Element(const std::string& name, const std::string& type,
                           const std::string& text = "", const std::string& attributes = "") {
  return "<" + name + " type=\"" + type + "\" " + attributes + ">" + text + "</" + name + ">";
}

inline std::string E57Xml(const std::string& scans, const std::string& images = "") {
  return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
         "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\">" +
         Element("data3D", "Vector", scans) +
         (images.empty() ? "" : Element("images2D", "Vector", images)) + "</e57Root>";
}

inline std::string ScanXml(uint64_t offset, size_t count, const std::string& prototype,
                           const std::string& more = "") {
  return Element(
      "vectorChild", "Structure",
      more + Element("points", "CompressedVector", Element("prototype", "Structure", prototype),
                     "fileOffset=\"" + std::to_string(offset) + "\" recordCount=\"" +
                         std::to_string(count) + "\""));
}

// Three fields of single precision.
inline std::string SinglesXml() {
  std::string xml;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"}) {
    xml += Element(name, "Float", "", "precision=\"single\"");
  }
  return xml;
}

inline std::string IntegerXml(const std::string& name, int64_t minimum, int64_t maximum) {
  return Element(
      name, "Integer", "",
      "minimum=\"" + std::to_string(minimum) + "\" maximum=\"" + std::to_string(maximum) + "\"");
}

// A file of structured scans, one per name: 2 x 2 points on a wall 3 m, 4 m ... away.
inline std::string E57OfWalls(const std::vector<std::string>& names) {
  E57Bytes file;
  std::string scans;
  for (size_t k = 0; k < names.size(); ++k) {
    const float y = 3.0f + static_cast<float>(k);
    const uint64_t offset = file.AddPoints(
        {StreamOf<float>({0, 0, 1, 1}), StreamOf<float>({y, y, y, y}),
         StreamOf<float>({1, 0, 1, 0}), BitStream({0, 1, 0, 1}, 1), BitStream({0, 0, 1, 1}, 1)});
    scans += ScanXml(offset, 4,
                     SinglesXml() + IntegerXml("rowIndex", 0, 1) + IntegerXml("columnIndex", 0, 1),
                     Element("name", "String", names[k]));
  }
  return file.Finish(E57Xml(scans));
}

}  // namespace roomtex
