"""No message of the package has a sentence that has to be read twice for its length."""

from messages import MOST, Message, messages


def test_no_sentence_of_a_message_is_long():
    found = messages()
    assert len(found) > 1500  # the strings are still found
    assert [f"{one.place}: {one.text}" for one in found if one.longest > MOST] == []


def test_words_are_counted_by_sentence():
    assert Message("", "a b c. d e").longest == 3
    assert Message("", "the number {…} is too large: give {…} or less").longest == 6
