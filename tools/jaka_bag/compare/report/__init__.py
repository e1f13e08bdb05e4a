"""The result of a comparison for people and machines.

text        a few lines, and plain data
junit       JUnit XML, a test case for each check
svg         small diagrams as SVG text
warping     dynamic time warping, only to be drawn
pictures    overlays of both runs, differences, time lines
html        one page that needs no network and no scripts
audit_page  the page about an audit
failure     the same files for a run that could not be compared
"""
