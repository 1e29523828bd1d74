#include "active_matching_slam/map/map_file.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/crc.hpp>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <stdexcept>

#include "support/fuzz.h"

namespace active_matching_slam {
namespace {

MapFileContent smallMap() {
  MapFileContent content;
  content.camera = {"left",
                    320,
                    240,
                    250.0,
                    251.0,
                    160.0,
                    120.0,
                    DistortionModel::kPlumbBob,
                    {-0.1, 0.01, 0.001, -0.001, 0.0}};
  content.template_size_px = 11;
  content.source_patch_size_px = 15;
  content.scale_source = 2;
  FilterOptions options;
  options.initial_sigma_focal = options.initial_sigma_radial = 0.01;
  options.initial_sigma_centre = 0.007;
  Ekf filter(options);
  CameraState start;
  start.readout_s = 0.02;
  start.lens = {0.005, -0.01, {0.004, -0.006}};
  filter.reset(start, 0.01 * Eigen::Matrix<double, 12, 12>::Identity());
  const CameraModel camera(content.camera);
  filter.addInverseDepthFeature(camera, {100.25, 80.5}, 0.5, 0.1);
  filter.addPointFeature({0.3, -0.2, 2.0}, 0.01 * Eigen::Matrix3d::Identity());
  filter.addInverseDepthFeature(camera, {200.0, 120.0});
  filter.removeFeatures({0});
  filter.addInverseDepthFeature(camera, {220.0, 20.0});
  filter.predict(0.1);
  content.camera_state = filter.camera();
  content.features = filter.features();
  content.covariance = filter.covariance();
  content.next_id = filter.nextId();
  for (const FeatureState& state : content.features) {
    MapFeature feature;
    feature.id = state.id;
    feature.attempts = 7;
    feature.successes = 5;
    feature.rates = {40 + state.id, 3, 2, 100000};
    feature.first_frame = 3;
    feature.patch.image.create(15, 15, CV_8UC1);
    for (int i = 0; i < 15 * 15; ++i)
      feature.patch.image.data[i] = static_cast<std::uint8_t>(state.id + 31 * i);
    feature.patch.pixel = {100.25, 80.5};
    feature.patch.center = {7.0, 7.0};
    if (state.id != 1) {  // of one nothing has been learnt yet
      feature.patch.slope_per_px = {0.001 * static_cast<double>(state.id), -0.0035};
      feature.patch.slope_information_px2 << 4.5e5, 1.25e4, 1.25e4, 3.75e5;
    }
    content.map.push_back(feature);
  }
  return content;
}

/// A folder of its own, removed at the end.
class MapFile : public testing::Test {
 protected:
  void SetUp() override {
    char name[] = "/tmp/map_file_test_XXXXXX";
    folder_ = ::mkdtemp(name);
    path_ = folder_ + "/room.map";
  }
  void TearDown() override {
    ::unlink(path_.c_str());
    EXPECT_EQ(::rmdir(folder_.c_str()), 0) << "something was left beside the map";
  }
  std::string folder_, path_;
};

void expectRefused(const std::string& bytes, const std::string& cause) {
  try {
    parseMap(bytes);
    FAIL() << "accepted, not refused for: " << cause;
  } catch (const std::runtime_error& error) {
    EXPECT_NE(std::string(error.what()).find(cause), std::string::npos) << error.what();
  }
}

void setNumber(std::string* bytes, std::size_t offset, std::uint64_t value, int size) {
  for (int i = 0; i < size; ++i) (*bytes)[offset + i] = static_cast<char>(value >> (8 * i) & 0xff);
}

/// Makes size and checksum right, so that the content itself is put to the test.
void seal(std::string* bytes) {
  setNumber(bytes, 16, bytes->size() - 24, 8);
  boost::crc_32_type crc;
  crc.process_bytes(bytes->data() + 16, bytes->size() - 16);
  setNumber(bytes, 12, crc.checksum(), 4);
}

TEST_F(MapFile, ReadsBackWhatWasWrittenBitForBit) {
  MapFileContent written = smallMap();
  written.graph.ids = {1, 2, 17};  // 17 has left the map
  written.graph.links = {{1, 2, 0.75, 4, false}, {2, 17, 1.0 / 3.0, 9, false}};
  writeMapFile(path_, written);
  writeMapFile(path_, written);  // over the old one
  const MapFileContent read = readMapFile(path_);
  EXPECT_EQ(read.camera.name, "left");
  EXPECT_EQ(read.camera.distortion, written.camera.distortion);
  EXPECT_EQ(read.camera_state.readout_s, 0.02);
  EXPECT_EQ(read.camera_state.lens.focal, 0.005);
  EXPECT_EQ(read.camera_state.lens.radial, -0.01);
  EXPECT_EQ(read.camera_state.lens.centre, Eigen::Vector2d(0.004, -0.006));
  EXPECT_EQ(read.covariance, written.covariance);
  EXPECT_EQ(read.next_id, 4);
  EXPECT_EQ(read.scale_source, 2);
  ASSERT_EQ(read.features.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(read.features[i].id, i + 1);
    EXPECT_EQ(read.features[i].offset, written.features[i].offset);
    EXPECT_EQ(read.features[i].bearing_world, written.features[i].bearing_world);
    EXPECT_EQ(cv::norm(read.map[i].patch.image, written.map[i].patch.image, cv::NORM_INF), 0.0);
    EXPECT_EQ(read.map[i].successes, 5);
    EXPECT_EQ(read.map[i].rates.successes, 41 + i);
    EXPECT_EQ(read.map[i].rates.pixels, 100000);
    EXPECT_EQ(read.map[i].patch.slope_per_px, written.map[i].patch.slope_per_px);
    EXPECT_EQ(read.map[i].patch.slope_information_px2, written.map[i].patch.slope_information_px2);
  }
  EXPECT_EQ(read.graph.ids, written.graph.ids);
  ASSERT_EQ(read.graph.links.size(), 2u);
  EXPECT_EQ(read.graph.links[1].information_bits, 1.0 / 3.0);
  EXPECT_EQ(read.graph.links[1].frames, 9);
  EXPECT_EQ(serializeMap(read), serializeMap(written));
}

TEST_F(MapFile, RefusesAGraphThatDoesNotFitTogether) {
  MapFileContent content = smallMap();
  content.graph.ids = {1, 2};
  content.graph.links = {{1, 5, 0.5, 3, false}};
  EXPECT_THROW(serializeMap(content), std::invalid_argument);
  content.graph.links = {{1, 2, -0.5, 3, false}};
  EXPECT_THROW(serializeMap(content), std::invalid_argument);
}

TEST_F(MapFile, AnAnchorAtTheOriginStaysThere) {
  MapFileContent content = smallMap();
  FeatureState& last = content.features.back();
  last.anchored_at_origin = true;
  last.anchor_world.setZero();
  const Eigen::Index n = content.covariance.rows();  // of which the last six are its own
  Eigen::MatrixXd P(n - 3, n - 3);
  P << content.covariance.topLeftCorner(n - 6, n - 6), content.covariance.topRightCorner(n - 6, 3),
      content.covariance.bottomLeftCorner(3, n - 6), content.covariance.bottomRightCorner(3, 3);
  content.covariance = P;
  const MapFileContent read = parseMap(serializeMap(content));
  EXPECT_TRUE(read.features.back().anchored_at_origin);
  EXPECT_FALSE(read.features.front().anchored_at_origin);
  EXPECT_EQ(read.features.back().size(), 3);
  EXPECT_EQ(read.covariance, P);
  EXPECT_EQ(serializeMap(read), serializeMap(content));
}

TEST_F(MapFile, AFilterGoesOnFromItAsIfNeverStopped) {
  const MapFileContent content = smallMap();
  const CameraModel camera(content.camera);
  Ekf before{FilterOptions()}, after{FilterOptions()};
  before.restore(content.camera_state, content.features, content.covariance, content.next_id);
  const MapFileContent read = parseMap(serializeMap(content));
  after.restore(read.camera_state, read.features, read.covariance, read.next_id);
  for (Ekf* filter : {&before, &after}) {
    filter->predict(0.1);
    filter->update(camera, {{2, {201.0, 121.0}, 0.0}, {1, {197.0, 95.0}, 0.0}});
    EXPECT_EQ(filter->addInverseDepthFeature(camera, {50.0, 50.0}), 4);
  }
  EXPECT_EQ(Eigen::MatrixXd(before.covariance()), Eigen::MatrixXd(after.covariance()));
  EXPECT_EQ(before.camera().position_world, after.camera().position_world);
}

TEST_F(MapFile, NamesFileAndCause) {
  const auto cause = [&](const std::string& path) {
    try {
      readMapFile(path);
    } catch (const std::runtime_error& error) {
      return std::string(error.what());
    }
    return std::string("none");
  };
  EXPECT_EQ(cause(path_), "can't read map " + path_ + ": No such file or directory");
  EXPECT_EQ(cause(folder_), "can't read map " + folder_ + ": it is not a file");
  std::ofstream(path_) << "%YAML:1.0";
  EXPECT_EQ(cause(path_), "can't read map " + path_ + ": it is not a map file");
  EXPECT_THROW(writeMapFile(folder_ + "/missing/room.map", smallMap()), std::runtime_error);
}

TEST_F(MapFile, AFaultyStateIsNotWrittenAndTheOldFileStays) {
  writeMapFile(path_, smallMap());
  MapFileContent faulty = smallMap();
  faulty.covariance(3, 3) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(writeMapFile(path_, faulty), std::runtime_error);
  EXPECT_EQ(readMapFile(path_).map.size(), 3u);
}

// The writer is killed again and again, wherever it happens to be: the file is always a whole map.
TEST_F(MapFile, AWriterKilledAtAnyMomentLeavesAWholeMap) {
  writeMapFile(path_, smallMap());
  const std::string bytes = serializeMap(smallMap());
  std::mt19937 random(1);
  for (int run = 0; run < 60; ++run) {
    const pid_t writer = ::fork();
    ASSERT_GE(writer, 0);
    if (writer == 0)
      for (;;) writeMapFile(path_, smallMap());
    ::usleep(random() % 10000);
    ::kill(writer, SIGKILL);
    ::waitpid(writer, nullptr, 0);
    EXPECT_EQ(serializeMap(readMapFile(path_)), bytes) << "run " << run;
  }
  for (const auto& left : std::filesystem::directory_iterator(folder_))
    if (left.path() != path_) std::filesystem::remove(left.path());  // what the dead had begun
}

TEST_F(MapFile, RefusesEveryTruncation) {
  const std::string bytes = serializeMap(smallMap());
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(parseMap(bytes.substr(0, size)), std::runtime_error) << size;
  for (std::size_t size = 24; size < bytes.size(); ++size) {
    std::string sealed = bytes.substr(0, size);
    seal(&sealed);
    EXPECT_THROW(parseMap(sealed), std::runtime_error) << size;
  }
}

TEST_F(MapFile, RefusesWhatIsDamagedOrTooNew) {
  std::string bytes = serializeMap(smallMap());
  bytes[bytes.size() / 2] ^= 1;
  expectRefused(bytes, "damaged");
  bytes = serializeMap(smallMap());
  setNumber(&bytes, 8, 7, 4);
  expectRefused(bytes, "version 7");
  bytes = serializeMap(smallMap());
  double infinity = std::numeric_limits<double>::infinity();
  std::memcpy(&bytes[bytes.size() - 8], &infinity, 8);
  seal(&bytes);
  expectRefused(bytes, "not finite");
  bytes = serializeMap(smallMap()) + std::string(8, '\0');
  seal(&bytes);
  expectRefused(bytes, "covariance");
  bytes = serializeMap(smallMap());
  setNumber(&bytes, 24, std::uint64_t{1} << 60, 8);
  seal(&bytes);
  expectRefused(bytes, "name");
}

TEST_F(MapFile, RefusesASlopeThatIsNone) {
  const auto expectSlopeRefused = [](const Eigen::Vector2d& slope, const Eigen::Matrix2d& known) {
    MapFileContent content = smallMap();
    content.map[1].patch.slope_per_px = slope;
    content.map[1].patch.slope_information_px2 = known;
    try {
      serializeMap(content);
      FAIL() << "accepted: " << slope.transpose() << "; " << known;
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), "feature 2 lies in a surface whose slope is not known");
    }
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Vector2d slope(0.001, 0.002);
  const Eigen::Matrix2d known = 1e5 * Eigen::Matrix2d::Identity();
  Eigen::Matrix2d skew = known, indefinite = known;
  skew(0, 1) = 10.0;
  indefinite(0, 1) = indefinite(1, 0) = 2e5;
  expectSlopeRefused({nan, 0.0}, known);
  expectSlopeRefused(slope, nan * known);
  expectSlopeRefused(slope, Eigen::Matrix2d::Zero());
  expectSlopeRefused(slope, -known);
  expectSlopeRefused(slope, skew);
  expectSlopeRefused(slope, indefinite);
}

/// What version 5 would have written of a map without submaps.
std::string version5Of(const MapFileContent& content) {
  std::string bytes = serializeMap(content);
  const auto n = static_cast<std::size_t>(content.covariance.rows());
  // An empty trunk (number, bits, two counts), the next number, submaps, features laid aside.
  const std::size_t empty = (4 + 3) * 8;
  bytes.erase(bytes.size() - 8 * (n * (n + 1) / 2) - empty, empty);
  setNumber(&bytes, 8, 5, 4);
  return bytes;
}

/// What version 4 would have written of a map without a graph.
std::string version4Of(const MapFileContent& content) {
  std::string bytes = version5Of(content);
  const auto n = static_cast<std::size_t>(content.covariance.rows());
  const std::size_t counts = 2 * 8;  // of features and links in the graph
  bytes.erase(bytes.size() - 8 * (n * (n + 1) / 2) - counts, counts);
  setNumber(&bytes, 8, 4, 4);
  return bytes;
}

/// What version 2 would have written: no slopes.
std::string version2Of(const MapFileContent& content) {
  std::string bytes = version4Of(content);
  for (const MapFeature& feature : content.map) {
    std::string side(8, 0);
    setNumber(&side, 0, static_cast<std::uint64_t>(feature.patch.image.rows), 8);
    const std::string image(reinterpret_cast<const char*>(feature.patch.image.data),
                            feature.patch.image.total());
    bytes.erase(bytes.find(side + image) - 6 * 8, 6 * 8);
  }
  setNumber(&bytes, 8, 2, 4);
  return bytes;
}

/// With a trunk of one feature and a submap of two, which hangs on it and on one of the map.
MapFileContent mapWithSubmaps() {
  MapFileContent content = smallMap();
  content.next_id = 9;
  content.next_submap = 5;
  const auto fill = [](Conditional* submap) {
    const auto rows = 3 * static_cast<Eigen::Index>(submap->ids.size());
    const auto columns = 5 + 3 * static_cast<Eigen::Index>(submap->given_ids.size());
    submap->mean = Eigen::VectorXd::LinSpaced(rows, 1.0, 2.0);
    submap->given_mean = Eigen::VectorXd::LinSpaced(columns, -1.0, 1.0);
    submap->K = submap->mean * submap->given_mean.transpose();
    submap->Q = 0.01 * Eigen::MatrixXd::Identity(rows, rows);
    submap->Q.topRightCorner(1, 1).setConstant(1.0 / 3000.0);
  };
  content.trunk.ids = {5};
  content.trunk.given_ids = {1, 3};
  fill(&content.trunk);
  Leaf submap;
  submap.id = 3;
  submap.lost_bits = 1.0 / 7.0;
  submap.points.ids = {8, 6};
  submap.points.given_ids = {1, 5};
  fill(&submap.points);
  content.submaps.push_back(submap);
  for (const FeatureId id : {5, 6, 8}) {
    content.frozen.push_back(content.map[0]);
    content.frozen.back().id = id;
    content.frozen.back().successes = static_cast<int>(id) - 1;
  }
  return content;
}

TEST_F(MapFile, KeepsWhatWasLaidAsideBitForBit) {
  const MapFileContent written = mapWithSubmaps();
  writeMapFile(path_, written);
  const MapFileContent read = readMapFile(path_);
  EXPECT_EQ(read.next_submap, 5);
  EXPECT_EQ(read.trunk.ids, written.trunk.ids);
  EXPECT_EQ(read.trunk.given_ids, written.trunk.given_ids);
  EXPECT_EQ(read.trunk.K, written.trunk.K);
  ASSERT_EQ(read.submaps.size(), 1u);
  EXPECT_EQ(read.submaps[0].id, 3);
  EXPECT_EQ(read.submaps[0].lost_bits, written.submaps[0].lost_bits);
  EXPECT_EQ(read.submaps[0].points.ids, written.submaps[0].points.ids);
  EXPECT_EQ(read.submaps[0].points.given_ids, written.submaps[0].points.given_ids);
  EXPECT_EQ(read.submaps[0].points.mean, written.submaps[0].points.mean);
  EXPECT_EQ(read.submaps[0].points.given_mean, written.submaps[0].points.given_mean);
  EXPECT_EQ(read.submaps[0].points.K, written.submaps[0].points.K);
  EXPECT_EQ(read.submaps[0].points.Q, written.submaps[0].points.Q);
  ASSERT_EQ(read.frozen.size(), 3u);
  EXPECT_EQ(read.frozen[2].id, 8);
  EXPECT_EQ(read.frozen[2].successes, 7);
  EXPECT_EQ(serializeMap(read), serializeMap(written));
}

TEST_F(MapFile, RefusesSubmapsThatHangOnNothing) {
  const auto expectFault = [](const MapFileContent& content, const std::string& fault) {
    try {
      serializeMap(content);
      FAIL() << "accepted, not refused for: " << fault;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(fault), std::string::npos) << error.what();
    }
  };
  MapFileContent content = mapWithSubmaps();
  content.submaps[0].points.given_ids[1] = 7;
  expectFault(content, "submap 3 hangs on feature 7");
  content = mapWithSubmaps();
  content.submaps[0].points.ids[0] = 5;
  expectFault(content, "submap 3 holds feature 5");
  content = mapWithSubmaps();
  content.trunk.Q(1, 1) = -1.0;
  expectFault(content, "the trunk has a negative variance");
  content = mapWithSubmaps();
  content.submaps[0].points.K.resize(6, 2);
  expectFault(content, "matrices of another size");
  content = mapWithSubmaps();
  content.frozen.pop_back();
  expectFault(content, "different in number");
  content = mapWithSubmaps();
  content.next_submap = 3;
  expectFault(content, "out of order");
}

TEST_F(MapFile, AMapOfVersion5IsReadAsItIs) {
  std::string old = version5Of(smallMap());
  seal(&old);
  EXPECT_EQ(serializeMap(parseMap(old)), serializeMap(smallMap()));
}

TEST_F(MapFile, MapsOfVersions3And4AreReadAsTheyAre) {
  const std::string bytes = serializeMap(smallMap());
  std::string old = version4Of(smallMap());  // without anchors at the origin that of version 3
  for (const std::uint64_t version : {3, 4}) {
    setNumber(&old, 8, version, 4);
    seal(&old);
    EXPECT_EQ(serializeMap(parseMap(old)), bytes);
  }
}

TEST_F(MapFile, AMapOfVersion2IsReadAndItsSurfacesFaceTheirFirstCameras) {
  MapFileContent content = smallMap();
  std::string bytes = version2Of(content);
  seal(&bytes);
  const MapFileContent read = parseMap(bytes);
  for (MapFeature& feature : content.map) {
    feature.patch.slope_per_px.setZero();
    feature.patch.slope_information_px2.setZero();
  }
  EXPECT_EQ(serializeMap(read), serializeMap(content));
}

TEST_F(MapFile, AMapOfVersion1IsReadAndItsCalibrationIsInDoubtAnew) {
  const MapFileContent content = smallMap();
  std::string bytes = version2Of(content);
  // What version 1 does not have: five numbers of the camera and their rows of the covariance.
  std::string readout(8, 0);
  std::memcpy(&readout[0], &content.camera_state.readout_s, 8);
  bytes.erase(bytes.find(readout), 5 * 8);
  const Eigen::Index n = content.covariance.rows();
  bytes.resize(bytes.size() - 8 * static_cast<std::size_t>(n * (n + 1) / 2));
  const auto isCalibration = [](Eigen::Index i) { return i >= 12 && i < 17; };
  for (Eigen::Index j = 0; j < n; ++j)
    for (Eigen::Index i = j; i < n; ++i)
      if (!isCalibration(i) && !isCalibration(j))
        bytes.append(reinterpret_cast<const char*>(&content.covariance(i, j)), 8);
  setNumber(&bytes, 8, 1, 4);
  seal(&bytes);
  const MapFileContent read = parseMap(bytes);
  EXPECT_EQ(read.camera_state.position_world, content.camera_state.position_world);
  EXPECT_EQ(read.camera_state.readout_s, 0.0);
  EXPECT_EQ(read.camera_state.lens.focal, 0.0);
  Eigen::MatrixXd expected = content.covariance;
  expected.middleRows<5>(12).setZero();
  expected.middleCols<5>(12).setZero();
  expected.diagonal().segment<5>(12) = calibrationSigmas(FilterOptions()).array().square();
  EXPECT_EQ(read.covariance, expected);
}

// Deterministic fuzz: files with bytes changed, numbers replaced, parts removed or doubled, with a
// right checksum. Each is either refused or a state that a filter can take over.
TEST_F(MapFile, MutatedFilesAreRefusedOrSound) {
  const std::string original = serializeMap(mapWithSubmaps());
  std::mt19937_64 random(1);
  constexpr std::uint64_t kNumbers[] = {0,
                                        1,
                                        255,
                                        0x7fffffff,
                                        0xffffffff,
                                        ~std::uint64_t{0},
                                        std::uint64_t{1} << 62,
                                        std::uint64_t{1} << 63,
                                        0x7ff0000000000000,
                                        0x7fefffffffffffff};
  int accepted = 0;
  for (int run = 0; run < fuzzInputs(30000); ++run) {
    std::string bytes = original;
    for (int change = 0; change <= static_cast<int>(random() % 3); ++change) {
      const std::size_t at = 24 + random() % (bytes.size() - 40);
      switch (random() % 4) {
        case 0:
          bytes[at] = static_cast<char>(random());
          break;
        case 1:
          setNumber(&bytes, at, kNumbers[random() % 10], 8);
          break;
        case 2:
          bytes.erase(at, 1 + random() % 16);
          break;
        default:
          bytes.insert(at, bytes.substr(at, 1 + random() % 16));
      }
      if (bytes.size() < 80) break;
    }
    if (run % 4 != 0) seal(&bytes);
    try {
      const MapFileContent content = parseMap(bytes);
      ++accepted;
      EXPECT_TRUE(content.covariance.allFinite());
      EXPECT_EQ(serializeMap(content), bytes) << "run " << run;
    } catch (const std::runtime_error&) {
    }
  }
  EXPECT_GT(accepted, 100) << "the fuzz never gets past the checks";
}

TEST(EkfRestore, RefusesWhatDoesNotFitTogetherAndChangesNothing) {
  const MapFileContent good = smallMap();
  Ekf filter{FilterOptions()};
  filter.restore(good.camera_state, good.features, good.covariance, good.next_id);
  const auto expectThrow = [&](MapFileContent bad) {
    EXPECT_THROW(filter.restore(bad.camera_state, bad.features, bad.covariance, bad.next_id),
                 std::invalid_argument);
  };
  MapFileContent bad = good;
  bad.next_id = 3;
  expectThrow(bad);
  bad = good;
  std::swap(bad.features[0], bad.features[1]);
  expectThrow(bad);
  bad = good;
  bad.covariance.conservativeResize(20, 20);
  expectThrow(bad);
  bad = good;
  bad.covariance(0, 1) = bad.covariance(1, 0) = 1.0;
  expectThrow(bad);
  bad = good;
  bad.covariance(0, 1) += 0.005;
  expectThrow(bad);
  bad = good;
  bad.camera_state.q_world_camera.w() = 2.0;
  expectThrow(bad);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  bad = good;
  bad.camera_state.readout_s = std::numeric_limits<double>::infinity();
  expectThrow(bad);
  bad = good;
  bad.camera_state.lens.focal = nan;
  expectThrow(bad);
  bad = good;
  bad.camera_state.lens.radial = nan;
  expectThrow(bad);
  bad = good;
  bad.camera_state.lens.centre.y() = nan;
  expectThrow(bad);
  bad = good;
  bad.features[1].inverse_depth = 0.0;
  expectThrow(bad);
  EXPECT_EQ(Eigen::MatrixXd(filter.covariance()), good.covariance);
  EXPECT_EQ(filter.nextId(), good.next_id);
}

TEST(EkfRestore, ARelocatedCameraHasNothingButItsCalibrationInCommonWithTheMap) {
  const MapFileContent content = smallMap();
  Ekf filter{FilterOptions()};
  filter.restore(content.camera_state, content.features, content.covariance, content.next_id);
  CameraState camera;
  camera.position_world << 1.0, 2.0, 3.0;
  filter.relocateCamera(camera, 0.04 * Eigen::Matrix<double, 12, 12>::Identity());
  const Eigen::MatrixXd P = filter.covariance();
  const int rest = filter.stateSize() - 12;
  EXPECT_EQ(filter.camera().position_world, camera.position_world);
  EXPECT_EQ(filter.camera().readout_s, content.camera_state.readout_s);
  EXPECT_EQ(filter.camera().lens.focal, content.camera_state.lens.focal);
  EXPECT_EQ(filter.camera().lens.radial, content.camera_state.lens.radial);
  EXPECT_EQ(filter.camera().lens.centre, content.camera_state.lens.centre);
  EXPECT_EQ(P.topLeftCorner(12, 12), 0.04 * Eigen::MatrixXd::Identity(12, 12));
  EXPECT_TRUE(P.topRightCorner(12, rest).isZero(0.0));
  EXPECT_TRUE(P.bottomLeftCorner(rest, 12).isZero(0.0));
  ASSERT_FALSE(P.block(12, CameraError::kSize, 5, rest - 5).isZero(1e-6));
  EXPECT_EQ(P.bottomRightCorner(rest, rest), content.covariance.bottomRightCorner(rest, rest));
}

}  // namespace
}  // namespace active_matching_slam
