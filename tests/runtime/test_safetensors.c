/* SPDX-License-Identifier: GPL-3.0-or-later */
/* Test safetensors files: round trips, refused files and checksums. */
#include <sys/stat.h>

#include "tests/helpers/test.h"

#include <supine/safetensors.h>

#include "runtime/safetensors/safetensors_file.h"

#include "tests/helpers/runtime_fixture.h"

/* Open a file in memory, of exactly its size, so that a sanitizer sees any read past its end. */
static supine_status open_text(const char *header, size_t data_size, supine_error *error) {
  const size_t length = strlen(header);
  const size_t size = 8 + length + data_size;
  unsigned char *bytes = malloc(size);
  assert_non_null(bytes);
  const uint64_t prefix = length;
  memcpy(bytes, &prefix, 8);
  memcpy(bytes + 8, header, length); /* NOLINT(bugprone-not-null-terminated-result) */
  memset(bytes + 8 + length, 7, data_size);
  supine_safetensors *file = NULL;
  const supine_status status = supine_safetensors_open_memory(bytes, size, "text", &file, error);
  assert_true((status == SUPINE_OK) == (file != NULL));
  supine_safetensors_close(file);
  free(bytes);
  return status;
}

static const float four[] = {1.5F, -2.25F, 3.125F, 1e-30F};
static const double two[] = {0.1, -1e300};
static const unsigned char bytes3[] = {9, 8, 255};
static const uint32_t words[] = {7, 4294967295U};

static void write_sample(const char *path, const char *value) {
  const supine_tensor tensors[] = {
      {"bytes", SUPINE_U8, 1, {3}, bytes3},
      {"four", SUPINE_F32, 2, {2, 2}, four},
      {"none", SUPINE_F32, 2, {0, 3}, NULL},
      {"two \"quoted\"\\\n", SUPINE_F64, 1, {2}, two},
      {"words", SUPINE_U32, 4, {1, 2, 1, 1}, words},
  };
  const supine_metadata metadata[] = {{"key", value}, {"", "empty key"}};
  supine_error error = {0};
  assert_int_equal(supine_safetensors_write(path, tensors, 5, metadata, 2, &error), SUPINE_OK);
}

TEST(test_write_then_open_same_content) {
  char *folder = fixture_folder();
  char path[128];
  (void)snprintf(path, sizeof path, "%s/a", folder);
  const char *value = "tab\t quote\" slash\\ \xC3\xA9 \xF0\x9F\xAB\x81 end";
  write_sample(path, value);
  supine_safetensors *file = NULL;
  assert_int_equal(supine_safetensors_open(path, &file, NULL), SUPINE_OK);
  assert_string_equal(supine_safetensors_metadata(file, "key"), value);
  assert_string_equal(supine_safetensors_metadata(file, ""), "empty key");
  assert_null(supine_safetensors_metadata(file, "absent"));
  assert_null(supine_safetensors_find(file, "absent"));
  assert_int_equal(supine_safetensors_verify(file, NULL), SUPINE_OK);
  const supine_tensor *tensor = supine_safetensors_find(file, "four");
  assert_non_null(tensor);
  assert_int_equal(tensor->dtype, SUPINE_F32);
  assert_int_equal(tensor->rank, 2);
  assert_int_equal(tensor->shape[0], 2);
  assert_int_equal(tensor->shape[1], 2);
  assert_memory_equal(tensor->data, four, sizeof four);
  tensor = supine_safetensors_find(file, "two \"quoted\"\\\n");
  assert_non_null(tensor);
  assert_int_equal((uintptr_t)tensor->data % 8, 0);
  assert_memory_equal(tensor->data, two, sizeof two);
  tensor = supine_safetensors_find(file, "words");
  assert_non_null(tensor);
  assert_int_equal(tensor->rank, 4);
  assert_memory_equal(tensor->data, words, sizeof words);
  tensor = supine_safetensors_find(file, "bytes");
  assert_non_null(tensor);
  assert_memory_equal(tensor->data, bytes3, sizeof bytes3);
  tensor = supine_safetensors_find(file, "none");
  assert_non_null(tensor);
  assert_int_equal(tensor->shape[0], 0);
  supine_safetensors_close(file);
  fixture_folder_remove(folder);
}

/* Data begin at a multiple of 8 bytes, for any length of the header. */
TEST(test_write_header_any_length_padded_to_eight_bytes) {
  char *folder = fixture_folder();
  char path[256];
  (void)snprintf(path, sizeof path, "%s/padded", folder);
  for (size_t length = 0; length < 16; ++length) {
    char value[17] = "0123456789abcdef";
    value[length] = '\0';
    write_sample(path, value);
    size_t size = 0;
    unsigned char *bytes = test_read(path, &size);
    uint64_t header = 0;
    memcpy(&header, bytes, sizeof header);
    assert_int_equal(header % 8, 0);
    assert_memory_equal(bytes + 8 + header, two, sizeof two); /* doubles are stored first */
    free(bytes);
  }
  (void)remove(path);
  fixture_folder_remove(folder);
}

TEST(test_write_bad_arguments_refused) {
  const supine_tensor good = {"a", SUPINE_U8, 1, {3}, bytes3};
  const supine_tensor twice[] = {good, good};
  const supine_tensor rank0 = {"a", SUPINE_U8, 0, {3}, bytes3};
  const supine_tensor rank5 = {"a", SUPINE_U8, 5, {3}, bytes3};
  const supine_tensor dtype = {"a", SUPINE_DTYPE_COUNT, 1, {3}, bytes3};
  const supine_tensor huge = {"a", SUPINE_F64, 2, {SIZE_MAX / 8, 2}, bytes3};
  const supine_tensor null = {"a", SUPINE_F64, 1, {2}, NULL};
  const supine_tensor reserved = {"__metadata__", SUPINE_U8, 1, {3}, bytes3};
  const supine_metadata checksum = {"checksum", "0"};
  const supine_metadata keys[] = {{"k", "1"}, {"k", "2"}};
  const supine_metadata latin = {"k", "a\xFFz"};
  const supine_metadata surrogate = {"k", "\xED\xA0\x80"};
  const supine_tensor cut = {"\xC3", SUPINE_U8, 1, {3}, bytes3};
  const supine_status bad = SUPINE_ERROR_ARGUMENT;
  assert_int_equal(supine_safetensors_write("/dev/null", twice, 2, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &rank0, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &rank5, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &dtype, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &huge, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &null, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &reserved, 1, NULL, 0, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &good, 1, &checksum, 1, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &good, 1, keys, 2, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &good, 1, &latin, 1, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &good, 1, &surrogate, 1, NULL), bad);
  assert_int_equal(supine_safetensors_write("/dev/null", &cut, 1, NULL, 0, NULL), bad);
}

TEST(test_write_refused_or_failing_leaves_no_file) {
  const supine_tensor good = {"a", SUPINE_U8, 1, {3}, bytes3};
  const supine_tensor twice[] = {good, good};
  const char *missing = "/nonexistent-folder/file";
  supine_error error;
  assert_int_equal(supine_safetensors_write(missing, &good, 1, NULL, 0, &error),
                   SUPINE_ERROR_WRITE);
  assert_says(error.message, missing);
  assert_int_equal(supine_safetensors_write("/dev/full", &good, 1, NULL, 0, &error),
                   SUPINE_ERROR_WRITE);
  assert_says(error.message, "No space left on device");
  char *folder = fixture_folder();
  char path[128];
  (void)snprintf(path, sizeof path, "%s/a", folder);
  assert_int_equal(supine_safetensors_write(path, twice, 2, NULL, 0, NULL), SUPINE_ERROR_ARGUMENT);
  assert_int_equal(rmdir(folder), 0); /* fails if a file is left in the folder */
  free(folder);
}

#define A8 "\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2]}"

TEST(test_open_valid_headers_accepted) {
  static const struct {
    const char *header;
    size_t data;
  } cases[] = {
      {"{}", 0},
      {"{}   ", 0},
      {"{" A8 "}", 2},
      {"{ \n\t\"a\" : { \"shape\" : [ 2 ] , \"data_offsets\":[0, 2 ],\"dtype\":\"U8\"} }  ", 2},
      {"{\"__metadata__\":{}," A8 "}", 2},
      {"{\"__metadata__\":{\"\\u00e9\\ud83e\\udec1\\/\\b\\f\\n\\r\\t\":\"\"}," A8 "}", 2},
      /* The data of `b` are not aligned to 4 bytes. */
      {"{\"b\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[2,6]}," A8 "}", 6},
      {"{\"e\":{\"dtype\":\"F64\",\"shape\":[0,9],\"data_offsets\":[2,2]}," A8 "}", 2},
      /* types that are not read */
      {"{\"a\":{\"dtype\":\"F16\",\"shape\":[1],\"data_offsets\":[0,2]}}", 2},
      {"{" A8 ",\"b\":{\"dtype\":\"I64\",\"shape\":[2,1],\"data_offsets\":[2,18]}}", 18},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_error error = {0};
    if (open_text(cases[i].header, cases[i].data, &error) != SUPINE_OK) {
      fail_msg("%s: %s", cases[i].header, error.message);
    }
  }
}

TEST(test_open_bad_headers_refused) {
  static const struct {
    const char *header;
    size_t data;
  } cases[] = {
      {"[]", 0},
      {" {}", 0},
      {"{", 0},
      {"{}x", 0},
      {"{" A8 "}", 1},        /* 1 byte of data; the header says 2 */
      {"{" A8 "}", 3},        /* 3 bytes of data; the header says 2 */
      {"{" A8 ",}", 2},       /* trailing comma */
      {"{" A8 " " A8 "}", 2}, /* missing comma */
      {"{" A8 "," A8 "}", 4}, /* two tensors named `a` */
      /* tensors whose bytes overlap */
      {"{" A8 ",\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[1,3]}}", 3},
      /* an unused byte between the tensors */
      {"{" A8 ",\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[3,5]}}", 5},
      /* two tensors with the same bytes of data */
      {"{" A8 ",\"b\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[2,0]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[3],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"F16\",\"shape\":[1],\"data_offsets\":[2,0]}}", 2},
      {"{" A8 ",\"b\":{\"dtype\":\"I64\",\"shape\":[1],\"data_offsets\":[2,10]}}", 9},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[],\"data_offsets\":[0,1]}}", 1},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[1,1,1,1,1],\"data_offsets\":[0,1]}}", 1},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[0],\"data_offsets\":[0]}}", 0},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"shape\":[2],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,2],\"x\":1}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[02],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[+2],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2.0],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[-2],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2e0],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":[]}", 0},
      {"{\"a\":{}}", 0},
      {"{\"a\"}", 0},
      {"{a:{}}", 0},
      /* Sizes that overflow 64 bits, as a number and as a product. */
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[18446744073709551618],\"data_offsets\":[0,2]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[0,18446744073709551618]}}", 2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[4294967296,4294967296],\"data_offsets\":[0,0]}}", 0},
      {"{\"a\":{\"dtype\":\"F64\",\"shape\":[2305843009213693952],\"data_offsets\":[0,0]}}", 0},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[18446744073709551615],"
       "\"data_offsets\":[0,18446744073709551615]}}",
       2},
      {"{\"a\":{\"dtype\":\"U8\",\"shape\":[2],\"data_offsets\":[18446744073709551613,"
       "18446744073709551615]}}",
       2},
      /* Invalid metadata strings and names. */
      {"{\"__metadata__\":{\"k\":1}}", 0},
      {"{\"__metadata__\":{\"k\":\"v\",}}", 0},
      {"{\"__metadata__\":{\"k\":\"v\",\"k\":\"w\"}}", 0},
      {"{\"__metadata__\":{},\"__metadata__\":{}}", 0},
      {"{\"__metadata__\":[]}", 0},
      {"{\"__metadata__\":{\"k\":\"v}", 0},
      {"{\"__metadata__\":{\"k\":\"\\", 0},
      {"{\"__metadata__\":{\"k\":\"\\x\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\\u0000\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\\u12g4\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\\u12", 0},
      {"{\"__metadata__\":{\"k\":\"\\ud83e\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\\ud83e\\u0041\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\\udec1\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"a\nb\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\xC0\x80\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\xE2\x82\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\xF5\x80\x80\x80\"}}", 0},
      {"{\"__metadata__\":{\"k\":\"\xF0\x9F", 0},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
    supine_error error = {0};
    if (open_text(cases[i].header, cases[i].data, &error) != SUPINE_ERROR_FORMAT) {
      fail_msg("accepted: %s", cases[i].header);
    }
    assert_says(error.message, "text: ");
  }
}

TEST(test_open_hostile_lengths_refused) {
  static const uint64_t lengths[] = {0, 1, 3, 100, UINT64_C(1) << 32, UINT64_MAX - 7, UINT64_MAX};
  for (size_t i = 0; i < sizeof lengths / sizeof *lengths; ++i) {
    unsigned char *bytes = malloc(10);
    assert_non_null(bytes);
    memcpy(bytes, &lengths[i], 8);
    bytes[8] = '{';
    bytes[9] = '}';
    supine_safetensors *file = NULL;
    assert_int_equal(supine_safetensors_open_memory(bytes, 10, "x", &file, NULL),
                     SUPINE_ERROR_FORMAT);
    free(bytes);
  }
  supine_safetensors *file = NULL;
  for (size_t size = 0; size < 10; ++size) {
    unsigned char *bytes = calloc(size + 1, 1);
    assert_non_null(bytes);
    bytes[0] = 2;
    assert_int_equal(supine_safetensors_open_memory(bytes, size, "x", &file, NULL),
                     SUPINE_ERROR_FORMAT);
    free(bytes);
  }
}

TEST(test_open_unreadable_paths_report_read_error) {
  supine_safetensors *file = NULL;
  supine_error error;
  assert_int_equal(supine_safetensors_open("/nonexistent", &file, &error), SUPINE_ERROR_READ);
  assert_null(file);
  assert_says(error.message, "/nonexistent");
  assert_int_equal(supine_safetensors_open("/tmp", &file, &error), SUPINE_ERROR_READ);
  assert_int_equal(supine_safetensors_open("/dev/null", &file, &error), SUPINE_ERROR_READ);
  supine_safetensors_close(NULL);
}

/* A pipe, which opening would wait for, is refused. */
TEST(test_open_pipe_refused_without_waiting) {
  char *folder = fixture_folder();
  char path[512];
  supine_safetensors *file = NULL;
  supine_error error = {0};
  (void)snprintf(path, sizeof path, "%s/pipe", folder);
  assert_int_equal(mkfifo(path, 0600), 0);
  (void)alarm(60);
  assert_int_equal(supine_safetensors_open(path, &file, &error), SUPINE_ERROR_READ);
  (void)alarm(0);
  assert_says(error.message, "not a regular file");
  fixture_folder_remove(folder);
}

TEST(test_open_memory_any_alignment_same_content) {
  char *folder = fixture_folder();
  char path[128];
  (void)snprintf(path, sizeof path, "%s/a", folder);
  write_sample(path, "v");
  size_t size = 0;
  unsigned char *bytes = test_read(path, &size);
  for (size_t shift = 0; shift < 8; ++shift) {
    unsigned char *moved = malloc(size + shift);
    assert_non_null(moved);
    memcpy(moved + shift, bytes, size);
    supine_safetensors *file = NULL;
    assert_int_equal(supine_safetensors_open_memory(moved + shift, size, "m", &file, NULL),
                     SUPINE_OK);
    const supine_tensor *tensor = supine_safetensors_find(file, "four");
    assert_non_null(tensor);
    assert_int_equal((uintptr_t)tensor->data % 4, 0);
    assert_memory_equal(tensor->data, four, sizeof four);
    assert_int_equal(supine_safetensors_verify(file, NULL), SUPINE_OK);
    supine_safetensors_close(file);
    free(moved);
  }
  free(bytes);
  fixture_folder_remove(folder);
}

TEST(test_checksum_any_changed_bit_or_order_differs) {
  /* Change each bit of data of several sizes, some near multiples of 64 bytes. */
  for (size_t size = 1; size <= 200; size += size < 130 ? 43 : 7) {
    unsigned char data[256] = {0};
    uint64_t random = size;
    for (size_t i = 0; i < size; ++i) {
      data[i] = (unsigned char)(128 * (1 + fixture_random(&random)));
    }
    const supine_tensor tensor = {"t", SUPINE_U8, 1, {size}, data};
    const uint64_t before = supine_safetensors_checksum(&tensor, 1, NULL, 0);
    for (size_t bit = 0; bit < 8 * size; ++bit) {
      data[bit / 8] ^= (unsigned char)(1U << bit % 8);
      assert_true(supine_safetensors_checksum(&tensor, 1, NULL, 0) != before);
      data[bit / 8] ^= (unsigned char)(1U << bit % 8);
    }
    const supine_tensor shorter = {"t", SUPINE_U8, 1, {size - 1}, data};
    assert_true(supine_safetensors_checksum(&shorter, 1, NULL, 0) != before);
  }
  const supine_tensor flat = {"a", SUPINE_F32, 1, {4}, four};
  const supine_tensor square = {"a", SUPINE_F32, 2, {2, 2}, four};
  const supine_tensor named = {"b", SUPINE_F32, 1, {4}, four};
  const supine_tensor typed = {"a", SUPINE_U32, 1, {4}, four};
  const uint64_t sum = supine_safetensors_checksum(&flat, 1, NULL, 0);
  assert_true(supine_safetensors_checksum(&square, 1, NULL, 0) != sum);
  assert_true(supine_safetensors_checksum(&named, 1, NULL, 0) != sum);
  assert_true(supine_safetensors_checksum(&typed, 1, NULL, 0) != sum);
  const supine_metadata pairs[] = {{"k", "v"}, {"checksum", "anything"}, {"v", "k"}};
  assert_true(supine_safetensors_checksum(&flat, 1, pairs, 1) != sum);
  assert_true(supine_safetensors_checksum(&flat, 1, pairs, 2) ==
              supine_safetensors_checksum(&flat, 1, pairs, 1));
  assert_true(supine_safetensors_checksum(&flat, 1, pairs, 3) !=
              supine_safetensors_checksum(&flat, 1, pairs, 1));
}

/* The checksum must never change: with another hash, every existing file would be refused. */
TEST(test_checksum_sample_literal) {
  const supine_tensor tensor = {"four", SUPINE_F32, 2, {2, 2}, four};
  const supine_metadata pair = {"key", "value"};
  assert_true(supine_safetensors_checksum(&tensor, 1, &pair, 1) == UINT64_C(0xE8C275EED575467E));
}
