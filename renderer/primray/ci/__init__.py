"""What a change of a repository does to the pictures of its stages: `primray ci`.

`repository` asks git for both sides and the files between them; `touched` finds the stages that these files reach;
`attribution` renders both sides, and each edit alone; `findings` and `findings_page` say what was found.
"""
