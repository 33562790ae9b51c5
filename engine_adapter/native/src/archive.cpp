#include "archive.hpp"

#include <array>
#include <cstring>
#include <utility>

#include "error.hpp"

namespace taichi_soft {

namespace {

constexpr char kMark[] = "TSOFTWLD";
constexpr uint32_t kVersion = 2;
constexpr size_t kHead = 32;

constexpr size_t kWidth[] = {0, 1, 4, 8, 4, 8};  // size of a number of each type [bytes]

template <typename Number>
constexpr uint32_t kType = 0;
template <>
constexpr uint32_t kType<unsigned char> = 1;
template <>
constexpr uint32_t kType<int32_t> = 2;
template <>
constexpr uint32_t kType<int64_t> = 3;
template <>
constexpr uint32_t kType<float> = 4;
template <>
constexpr uint32_t kType<double> = 5;

[[noreturn]] void damaged(const std::string& why) {
  fail(TS_ERROR_FILE, "the world file is damaged: %s. Export it again", why.c_str());
}

size_t filled_up(size_t size) { return (size + 7) / 8 * 8; }

// Reads numbers in sequence. Reading beyond the end of the bytes fails.
class Reader {
 public:
  Reader(const char* begin, size_t size) : at_(begin), left_(size) {}

  template <typename Number>
  Number number() {
    Number found;
    std::memcpy(&found, bytes(sizeof found), sizeof found);
    return found;
  }

  const char* bytes(size_t size) {
    if (size > left_) damaged("it is cut off");
    const char* found = at_;
    at_ += size;
    left_ -= size;
    return found;
  }

  size_t left() const { return left_; }

 private:
  const char* at_;
  size_t left_;
};

}  // namespace

uint32_t checksum(const char* bytes, size_t size, uint32_t before) {
  static const std::array<uint32_t, 256> table = [] {
    std::array<uint32_t, 256> made{};
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t code = i;
      for (int k = 0; k < 8; ++k) code = code & 1 ? 0xEDB88320u ^ (code >> 1) : code >> 1;
      made[i] = code;
    }
    return made;
  }();
  uint32_t code = ~before;
  for (size_t i = 0; i < size; ++i) code = table[(code ^ static_cast<unsigned char>(bytes[i])) & 255] ^ (code >> 8);
  return ~code;
}

Archive::Archive(std::vector<char> bytes, const std::string& name) : bytes_(std::move(bytes)) {
  if (bytes_.size() < kHead || std::memcmp(bytes_.data(), kMark, 8) != 0) {
    fail(TS_ERROR_FILE, "%s is not a world file: give a folder from `taichi-soft export`", name.c_str());
  }
  Reader head(bytes_.data() + 8, kHead - 8);
  const uint32_t version = head.number<uint32_t>(), count = head.number<uint32_t>();
  const uint64_t size = head.number<uint64_t>();
  const uint32_t sum = head.number<uint32_t>(), unused = head.number<uint32_t>();
  if (version != kVersion) {
    fail(TS_ERROR_VERSION, "the world file has version %u, and this library reads version %u: export it again", version,
         kVersion);
  }
  if (size != bytes_.size() - kHead) damaged("its length is wrong");
  if (unused != 0 || sum != checksum(bytes_.data() + kHead, size)) damaged("its checksum is wrong");
  Reader reader(bytes_.data() + kHead, size);
  for (uint32_t i = 0; i < count; ++i) {
    const uint32_t length = reader.number<uint32_t>(), type = reader.number<uint32_t>();
    const uint32_t dimensions = reader.number<uint32_t>();
    reader.number<uint32_t>();
    if (type < 1 || type > 5 || dimensions > 4) damaged("an entry has an unknown type");
    Entry entry{type, {}, 1, nullptr};
    for (uint32_t k = 0; k < dimensions; ++k) {
      const uint64_t rows = reader.number<uint64_t>();
      if (rows > size || (rows > 0 && entry.count > size / rows)) damaged("an entry is too large");
      entry.sizes.push_back(rows);
      entry.count *= rows;
    }
    const std::string name(reader.bytes(filled_up(length)), length);
    entry.data = reader.bytes(filled_up(entry.count * kWidth[type]));
    entries_[name] = entry;
  }
}

const Archive::Entry& Archive::entry(const std::string& name, uint32_t type) const {
  const auto found = entries_.find(name);
  if (found == entries_.end() || found->second.type != type) {
    fail(TS_ERROR_VERSION, "the world file has no %s: it is of another version. Export it again", name.c_str());
  }
  return found->second;
}

template <typename Number>
Archive::View<Number> Archive::get(const std::string& name) const {
  const Entry& found = entry(name, kType<Number>);
  return {reinterpret_cast<const Number*>(found.data), found.sizes, found.count};
}

template <typename Number>
Archive::View<Number> Archive::rows(const std::string& name, size_t width) const {
  View<Number> found = get<Number>(name);
  if (found.count != 0 && (found.sizes.size() != 2 || found.sizes[1] != width)) {
    damaged(name + " has rows of the wrong length");
  }
  return found;
}

std::vector<std::string> Archive::texts(const std::string& name) const {
  const View<unsigned char> bytes = get<unsigned char>(name);
  std::vector<std::string> found;
  std::string text;
  for (unsigned char letter : bytes) {
    if (letter == 0) {
      found.push_back(text);
      text.clear();
    } else {
      text.push_back(static_cast<char>(letter));
    }
  }
  if (!text.empty()) damaged(name + " has no end");
  return found;
}

template Archive::View<unsigned char> Archive::get(const std::string&) const;
template Archive::View<int32_t> Archive::get(const std::string&) const;
template Archive::View<int64_t> Archive::get(const std::string&) const;
template Archive::View<float> Archive::get(const std::string&) const;
template Archive::View<double> Archive::get(const std::string&) const;
template Archive::View<int32_t> Archive::rows(const std::string&, size_t) const;
template Archive::View<int64_t> Archive::rows(const std::string&, size_t) const;
template Archive::View<float> Archive::rows(const std::string&, size_t) const;
template Archive::View<double> Archive::rows(const std::string&, size_t) const;

}  // namespace taichi_soft
