// Named arrays in one file. taichi_soft/export/archive.py writes such files.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace taichi_soft {

std::vector<char> read_file(const std::string& path);
uint32_t checksum(const char* bytes, size_t size, uint32_t before = 0);  // CRC-32 (IEEE 802.3), continued from `before`

class Archive {
 public:
  Archive(std::vector<char> bytes, const std::string& name);  // the name is for error messages

  // Numbers of an array, valid while the archive exists. Fails if there is no array with this name and type.
  template <typename Number>
  struct View {
    const Number* data;
    std::vector<size_t> sizes;
    size_t count;
    const Number& operator[](size_t i) const { return data[i]; }
    const Number* begin() const { return data; }
    const Number* end() const { return data + count; }
  };

  template <typename Number>
  View<Number> get(const std::string& name) const;
  // Numbers of an array. Fails in the same cases as `get`, and unless each row has `width` numbers.
  template <typename Number>
  View<Number> rows(const std::string& name, size_t width) const;
  std::vector<std::string> texts(const std::string& name) const;

 private:
  struct Entry {
    uint32_t type;
    std::vector<size_t> sizes;
    size_t count;
    const char* data;
  };
  const Entry& entry(const std::string& name, uint32_t type) const;

  std::vector<char> bytes_;
  std::map<std::string, Entry> entries_;
};

}  // namespace taichi_soft
