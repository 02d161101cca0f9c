// A JPEG is read to its end without its pixels: decoders fill what is cut off or damaged with colours of their own.
#include "arrays.hpp"

#include <algorithm>
#include <array>
#include <vector>

namespace {

constexpr std::size_t kMostPixels = std::size_t{1} << 26;
constexpr std::size_t kMostPadding = 7;  // bytes before the end: some cameras fill up their frames to whole words
constexpr int kMostScans = 100;
constexpr int kCoefficients = 64;

struct Fault {
    const char* what;
};
constexpr Fault kCutOff{"is cut off: it has no end"}, kDamaged{"is damaged: its pixels end too early or too late"};
struct Unknown {};  // a kind of JPEG whose pixels are not followed here

// The bits of a scan, without the zeros that follow a byte 0xff, up to the next marker.
class Bits {
public:
    Bits(const uint8_t* begin, const uint8_t* end) : at_(begin), end_(end) {}

    uint32_t peek16() {
        for (; count_ < 16; count_ += 8) {
            uint8_t byte = 0;
            if (at_ == end_ || (*at_ == 0xff && (end_ - at_ < 2 || at_[1] != 0)))
                missing_ += 8;
            else if ((byte = *at_++) == 0xff)
                ++at_;
            bits_ = bits_ << 8 | byte;
        }
        return bits_ >> (count_ - 16) & 0xffff;
    }
    void skip(int n) {
        peek16();
        count_ -= n;
        if (count_ < missing_) throw end_ - at_ < 2 ? kCutOff : kDamaged;
    }
    uint32_t take(int n) {
        const uint32_t value = peek16() >> (16 - n);
        skip(n);
        return value;
    }
    std::size_t whole_bytes() const { return static_cast<std::size_t>(count_ - missing_) / 8; }
    const uint8_t* at() const { return at_; }

private:
    const uint8_t *at_, *end_;
    uint64_t bits_ = 0;
    int count_ = 0, missing_ = 0;
};

struct Huffman {
    std::array<uint32_t, 18> limit{};  // codes of each length, filled up to 16 bits, are below it
    std::array<int, 17> offset{};
    std::vector<uint8_t> symbols;

    int next(Bits& bits) const {
        if (symbols.empty()) throw Unknown{};  // those of video without tables, which everybody is to know
        const uint32_t code = bits.peek16();
        int length = 1;
        while (length < 17 && code >= limit[length]) ++length;
        if (length == 17) throw kDamaged;
        bits.skip(length);
        return symbols[static_cast<std::size_t>(static_cast<int>(code >> (16 - length)) + offset[length])];
    }
};

struct Component {
    int id, across, down;                           // blocks of an MCU
    std::size_t columns = 0, rows = 0, stride = 0;  // blocks in the image; in a row of MCUs
    int huffman[2] = {0, 0};
    std::vector<uint64_t> nonzero;  // coefficients of each block, a bit each
};

class Jpeg {
public:
    Jpeg(const uint8_t* data, std::size_t size) : at_(data), end_(data + size) {}

    void read() {
        for (at_ += 2;;) {
            const int marker = next_marker();
            if (marker == 0xd9) break;
            const uint8_t* body = at_ + 2;
            const std::size_t length = end_ - at_ < 2 ? 0 : word(at_);
            if (static_cast<std::size_t>(end_ - at_) < length) throw kCutOff;
            if (length < 2) throw kDamaged;
            at_ += length;
            if (marker == 0xc4)
                read_tables(body);
            else if (marker == 0xdd && length == 4)
                interval_ = word(body);
            else if (marker == 0xda)
                read_scan(body);
            else if (marker >= 0xc0 && marker <= 0xcf && marker != 0xc8 && marker != 0xcc)
                read_frame(body, marker);
        }
        if (!scans_) throw kDamaged;
    }

    // Whether the segments lead to the end marker, whatever the pixels are.
    void seek_end() {
        while (true) {
            const int marker = next_marker();
            if (marker == 0xd9) return;
            if ((marker >= 0xd0 && marker <= 0xd7) || end_ - at_ < 2) continue;
            at_ += std::min<std::ptrdiff_t>(word(at_), end_ - at_);
        }
    }

private:
    static std::size_t word(const uint8_t* at) { return static_cast<std::size_t>(at[0] << 8 | at[1]); }

    uint8_t byte(const uint8_t*& body) {
        if (body >= at_) throw kDamaged;
        return *body++;
    }

    int next_marker() {
        for (skipped_ = 0;;) {
            const uint8_t* before = at_;
            at_ = std::find(at_, end_, 0xff);
            skipped_ += static_cast<std::size_t>(at_ - before);
            while (at_ < end_ && *at_ == 0xff) ++at_;
            if (at_ == end_) throw kCutOff;
            if (const int marker = *at_++) return marker;
            skipped_ += 2;
        }
    }

    void read_tables(const uint8_t* body) {
        while (body < at_) {
            const int which = byte(body);
            if ((which & 0xef) > 3) throw kDamaged;
            Huffman& table = huffman_[which >> 4][which & 3];
            uint32_t code = 0, total = 0;
            for (int length = 1; length <= 16; ++length) {
                const uint32_t count = byte(body);
                table.offset[length] = static_cast<int>(total) - static_cast<int>(code);
                total += count;
                code += count;
                table.limit[length] = code << (16 - length);
                if (table.limit[length] > 1 << 16) throw kDamaged;
                code <<= 1;
            }
            table.symbols.clear();
            while (total--) table.symbols.push_back(byte(body));
        }
    }

    void read_frame(const uint8_t* body, int marker) {
        progressive_ = marker == 0xc2;
        if (marker > 0xc2 || byte(body) != 8) throw Unknown{};
        std::size_t height = byte(body), width;
        height = height << 8 | byte(body);
        width = byte(body);
        width = width << 8 | byte(body);
        if (!height) throw Unknown{};
        if (width * height > kMostPixels) throw Fault{"has more than 67 million pixels; make it smaller"};
        components_.assign(byte(body), {});
        std::size_t across = 1, down = 1;
        for (Component& each : components_) {
            each.id = byte(body);
            const int both = byte(body);
            each.across = both >> 4, each.down = both & 15;
            byte(body);  // its quantisation
            if (each.across < 1 || each.across > 4 || each.down < 1 || each.down > 4) throw kDamaged;
            across = std::max<std::size_t>(across, each.across);
            down = std::max<std::size_t>(down, each.down);
        }
        mcus_across_ = (width + 8 * across - 1) / (8 * across);
        mcus_down_ = (height + 8 * down - 1) / (8 * down);
        for (Component& each : components_) {
            each.columns = ((width * each.across + across - 1) / across + 7) / 8;
            each.rows = ((height * each.down + down - 1) / down + 7) / 8;
            each.stride = mcus_across_ * each.across;
            if (progressive_) each.nonzero.assign(each.stride * mcus_down_ * each.down, 0);
        }
    }

    void read_scan(const uint8_t* body) {
        std::vector<Component*> chosen(byte(body));
        for (Component*& each : chosen) {
            const int id = byte(body), tables = byte(body);
            const auto found = std::find_if(components_.begin(), components_.end(),
                                            [id](const Component& component) { return component.id == id; });
            if (found == components_.end() || (tables & 0xcc)) throw kDamaged;
            each = &*found;
            each->huffman[0] = tables >> 4, each->huffman[1] = tables & 3;
        }
        first_ = byte(body), last_ = byte(body);
        const int bits = byte(body);
        refines_ = bits >> 4, shift_ = bits & 15;
        if (!progressive_) first_ = 0, last_ = kCoefficients - 1, refines_ = shift_ = 0;
        if (chosen.empty() || last_ >= kCoefficients || first_ > last_ || shift_ > 13 ||
            (progressive_ && first_ && chosen.size() > 1))
            throw kDamaged;
        const bool alone = chosen.size() == 1;
        const std::size_t columns = alone ? chosen[0]->columns : mcus_across_;
        const std::size_t total = columns * (alone ? chosen[0]->rows : mcus_down_);
        for (std::size_t mcu = 0; mcu < total;) {
            Bits source(at_, end_);
            run_ = 0;
            const std::size_t stop = interval_ ? std::min(total, mcu + interval_) : total;
            for (; mcu < stop; ++mcu)
                for (Component* each : chosen) {
                    const std::size_t row = mcu / columns, column = mcu % columns;
                    const int across = alone ? 1 : each->across, down = alone ? 1 : each->down;
                    for (int i = 0; i < across * down; ++i)
                        read_block(source, *each,
                                   (row * down + i / across) * each->stride + column * across + i % across);
                }
            if (run_) throw kDamaged;
            at_ = source.at();
            const int marker = next_marker();
            if (mcu < total ? marker != static_cast<int>(0xd0 + (mcu / interval_ - 1) % 8)
                            : marker < 0xd8 && marker >= 0xd0)
                throw kDamaged;
            if (source.whole_bytes() + skipped_ > (marker == 0xd9 ? kMostPadding : 0)) throw kDamaged;
            if (mcu == total) at_ -= 2;  // read again, as that of a segment
        }
        if (++scans_ > kMostScans) throw kDamaged;
    }

    void read_block(Bits& source, Component& component, std::size_t block) {
        int k = first_;
        if (!k) {
            if (refines_)
                source.skip(1);
            else {
                const int size = huffman_[0][component.huffman[0]].next(source);
                if (size > 15) throw kDamaged;
                source.skip(size);
            }
            if (progressive_) return;
            ++k;
        }
        const Huffman& table = huffman_[1][component.huffman[1]];
        uint64_t unused = 0, &nonzero = progressive_ ? component.nonzero[block] : unused;
        const auto known = [&nonzero](int at) { return nonzero >> at & 1; };
        for (; !run_ && k <= last_; ++k) {
            const int symbol = table.next(source), size = symbol & 15;
            int zeros = symbol >> 4;
            if (!size && zeros < 15) {  // the rest of the block is zero and, of a progressive JPEG, of more blocks
                if (!progressive_) return;
                run_ = (1 << zeros) + static_cast<int>(source.take(zeros));
                break;
            }
            source.skip(size);
            for (; k <= last_ && (refines_ ? known(k) || zeros-- : zeros-- > 0); ++k)
                if (refines_ && known(k)) source.skip(1);
            if (size && k > last_) throw kDamaged;
            if (size) nonzero |= uint64_t{1} << k;
        }
        if (!run_) return;
        for (; refines_ && k <= last_; ++k)
            if (known(k)) source.skip(1);
        --run_;
    }

    const uint8_t *at_, *end_;
    Huffman huffman_[2][4];
    std::vector<Component> components_;
    std::size_t mcus_across_ = 0, mcus_down_ = 0, interval_ = 0, skipped_ = 0;
    bool progressive_ = false;
    int first_ = 0, last_ = 0, refines_ = 0, shift_ = 0, run_ = 0, scans_ = 0;
};

const char* jpeg_fault(In<uint8_t, -1> data) {
    nb::gil_scoped_release released;
    try {
        if (data.size() < 2) throw kCutOff;
        Jpeg jpeg(data.data(), data.size());
        try {
            jpeg.read();
        } catch (const Unknown&) {
            jpeg.seek_end();
        }
    } catch (const Fault& fault) {
        return fault.what;
    }
    return "";
}

}  // namespace

void bind_jpeg(nb::module_& m) {
    m.def("jpeg_fault", &jpeg_fault, named("data"),
          "Why the bytes (N,) of a JPEG are not a whole one, such as 'is cut off: it has no end'; empty if they are. "
          "Source: ITU-T T.81.");
}
